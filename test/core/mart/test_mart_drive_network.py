# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that the robot drives as commanded on a network that loses and delays datagrams."""

import math

import pytest
from mart_bench import MartBench
from mart_goals import EVERY_FIRMWARE, drops, on
from test_mart_late_replies import once, texts

from omnibot_driver.core.mart.jobs import Job
from omnibot_driver.simulator.common.network import NetworkFaults
from omnibot_driver.simulator.mart import Firmware

pytestmark = pytest.mark.slow


def seconds_to_move(bench: MartBench, vx: float, limit_s: float = 9.0) -> float:
    """Command the speed until the robot moves, or for ``limit_s``. Return the duration in s."""
    began_s: float = bench.now
    while bench.robot.stands and bench.now < began_s + limit_s:
        bench.command(vx, 0.0, 0.1)
    return float(bench.now - began_s)


@pytest.mark.parametrize("firmware", ["documented", "firmware"])
@pytest.mark.parametrize("vx", [0.3, -0.2])
def test_most_drives_go_on_although_datagrams_take_up_to_three_tenths_of_a_second(
    vx: float, firmware: Firmware
) -> None:
    """If each datagram is late by up to 0.3 s, the driver stops none of four drives.

    At most one drive still has a wrong speed after 5 s.
    """
    slow = 0
    for seed in range(4):
        bench = on(NetworkFaults(delay_s=0.3), firmware, seed)
        bench.command(vx, 0.0, 5.0)
        began_m = bench.truth.x_m
        bench.command(vx, 0.0, 3.0)
        assert texts(bench) == []
        slow += abs(bench.truth.x_m - began_m - 3.0 * vx) > 0.12 * abs(3.0 * vx)
    assert slow <= 1


@pytest.mark.parametrize("firmware", EVERY_FIRMWARE)
@pytest.mark.parametrize("seed", range(2))
def test_lost_replies_neither_stop_a_drive_nor_show_a_dead_imu(
    seed: int, firmware: Firmware
) -> None:
    """A tenth of all datagrams is lost each way.

    The driver stops the robot in one case only: RM, which starts the drive, is not answered.
    """
    bench = on(NetworkFaults(lose=0.1), firmware, seed)
    bench.command(0.3, 0.0, 10.0)
    assert set(texts(bench)) <= {"the controller did not answer RM; robot stopped"}


def test_the_first_heading_of_a_drive_does_not_show_that_the_imu_is_dead() -> None:
    """A first heading that arrives 0.9 s after the start of a drive does not show a dead IMU.

    One heading cannot show that the heading is constant.
    """
    bench, started_s = on(NetworkFaults(), "firmware"), math.inf

    def lost(data: bytes) -> bool:
        return bool(bench.written[-1][1] == b"RMRA" and bench.now < started_s + 0.9)

    drops(bench.robot.network[0].from_board, lost)
    bench.command(0.1, 0.0, seconds_to_move(bench, 0.1))
    started_s = bench.now
    bench.command(0.1, 0.0, 3.0)
    assert texts(bench) == []
    assert not bench.robot.stands


@pytest.mark.parametrize(("firmware", "seed"), [("firmware", 5), ("source", 14)])
def test_three_equal_headings_are_needed_to_show_a_dead_imu(firmware: Firmware, seed: int) -> None:
    """Two equal headings in a row do not show a dead IMU.

    Each drive of this test has two equal headings by chance, because replies are late.
    """
    bench = on(NetworkFaults(delay_s=0.2), firmware, seed)
    for _ in range(3):
        bench.command(-0.2, 0.0, 6.0)
        bench.command(0.3, 0.0, 6.0)
    assert not any("IMU" in each for each in texts(bench))


def test_an_answer_to_hello_ends_the_wait_for_a_lost_count() -> None:
    """If a later HELLO is answered but ENC (encoder query) is not, the driver repeats ENC.

    The server answers in order, so the answer to HELLO shows the loss. ENC is repeated within 0.25
    s.
    """
    bench = on(NetworkFaults(), "firmware")
    bench.command(0.3, 0.0, 3.0)
    first = len(bench.written)
    path = bench.robot.network[0].from_board
    gone = drops(path, once(lambda data: bench.written[-1][1] == b"ENC"))
    bench.run_until(lambda: bool(gone))
    lost_s = bench.now
    asked = sum(data == b"ENC" for _, data in bench.written[first:])
    while sum(data == b"ENC" for _, data in bench.written[first:]) == asked:
        bench.run(0.01)
    assert bench.now - lost_s < 0.25


@pytest.mark.parametrize(("vx", "start"), [(0.3, b"RM"), (-0.2, b"B SLOW")])
@pytest.mark.parametrize("firmware", ["firmware", "source"])
def test_a_lost_start_is_sent_again_soon(firmware: Firmware, vx: float, start: bytes) -> None:
    """The first start command is lost, but the server answers HELLO: it has not been restarted.

    The driver soon sends the start command again, so the robot moves within 1.5 s.
    """
    bench = on(NetworkFaults(), firmware)
    path = bench.robot.network[0].to_board
    lost = drops(path, once(lambda data: data.startswith(start)))
    assert seconds_to_move(bench, vx) < 1.5
    assert len(lost) == 1


def test_a_server_that_restarts_at_a_start_is_left_alone() -> None:
    """The command that starts a drive (RM) is lost, and the server is silent for 0.5 s.

    The server may have restarted, so the driver waits for 1.5 s before it sends RM again.
    """
    bench = on(NetworkFaults(), "firmware")
    network, away_s = bench.robot.network[0], math.inf

    def lost(data: bytes) -> bool:
        nonlocal away_s
        if data.startswith(b"RM ") and math.isinf(away_s):
            away_s = bench.now
        return bench.now < away_s + 0.5 and not math.isinf(away_s)

    drops(network.to_board, lost)
    seconds_to_move(bench, 0.3)
    starts_s = [at_s for at_s, _, data in bench.server.received if data.startswith(b"RM ")]
    assert bench.now - away_s > 2.0
    assert starts_s


def test_an_incomplete_download_is_not_an_absence_of_the_server() -> None:
    """A download loses one piece, and fails after a wait of 1 s.

    The driver does not take the silence for a restart of the server, and begins the next drive at
    once.
    """
    bench = on(NetworkFaults(), "firmware")
    bench.command(0.3, 0.0, 2.0)
    bench.run(2.0)
    assert bench.job(Job.LOG).success
    bench.command(0.3, 0.0, 2.0)
    bench.run(2.0)
    drops(bench.robot.network[0].from_board, once(lambda data: len(data) == 512))
    assert "were lost" in bench.job(Job.LAST_MOVE).message
    bench.run(0.1)
    assert not bench.board._pilot.jobs.log_may_be_lost
    assert seconds_to_move(bench, 0.3) < 0.8


@pytest.mark.parametrize("lost_way", ["request", "reply"])
@pytest.mark.parametrize("firmware", EVERY_FIRMWARE)
def test_an_unanswered_change_of_the_motors_leaves_no_wrong_speed(
    firmware: Firmware, lost_way: str
) -> None:
    """The driver changes the motors' speeds, and gets no reply. It soon corrects the turn rate.

    The measured speeds show whether the change has arrived.
    """
    bench = on(NetworkFaults(), firmware)
    bench.command(0.2, 0.4, 3.0)
    way = bench.robot.network[0]
    lost: list[bytes] = []

    def hides(data: bytes) -> bool:
        changed = bench.written[-1][1].startswith(b"RMCS")
        return changed and not lost and (lost_way == "reply" or data.startswith(b"RMCS"))

    path = way.to_board if lost_way == "request" else way.from_board
    drops(path, lambda data: hides(data) and lost.append(data) is None)
    bench.command(0.2, -0.4, 3.0)
    rates = []
    for _ in range(10):
        bench.command(0.2, -0.4, 0.1)
        rates.append(bench.robot.board.facts["yaw_rate_radps"])
    assert lost
    assert sum(rates) / len(rates) == pytest.approx(-0.4, abs=0.04)
    assert texts(bench) == []
