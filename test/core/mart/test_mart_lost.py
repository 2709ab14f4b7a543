# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of a lost server: the driver uses the stop port, and then asks which motion runs."""

import pytest
from mart_bench import MartBench

from omnibot_driver.simulator.common.network import NetworkFaults
from omnibot_driver.simulator.mart import Firmware

pytestmark = pytest.mark.slow


def outlived(
    firmware: Firmware, motion: tuple[float, float], delay_s: float = 0.0, seed: int = 0
) -> MartBench:
    """Return a test bench with a server whose stop port has hung since the IMU died in a motion.

    Now the IMU works again.
    """
    bench = MartBench(firmware, NetworkFaults(delay_s=delay_s), seed=seed).ready()
    bench.command(*motion, 2.5)
    bench.server.imu.alive = False
    bench.command(*motion, 3.0)
    bench.run(7.0)
    assert any(notice.startswith("server lost: ") for notice in bench.notices)
    bench.server.imu.alive = True
    bench.run(5.0)
    assert bench.robot.board.facts["stop_port_hung"]
    return bench


@pytest.mark.parametrize(
    ("motion", "firmware", "boot_s", "gap_s"),
    [
        ((0.3, 0.1), "source", 0.3, 2.0),
        ((0.3, 0.1), "source", 5.0, 3.5),
        ((0.3, 0.1), "firmware", 5.0, 3.5),
        ((0.3, 0.1), "firmware", 5.0, 40.0),
        ((-0.2, 0.0), "source", 5.0, 2.0),
    ],
)
def test_a_lost_server_that_answers_again_without_a_restart_is_not_driven(
    motion: tuple[float, float], firmware: Firmware, boot_s: float, gap_s: float
) -> None:
    """The IMU dies in a motion, the stop port hangs, and later the IMU works again.

    The driver sends no motion until the server restarts. A network gap and a changed heading do not
    show a restart.
    """
    bench = outlived(firmware, motion)
    bench.speaks = False
    bench.run(gap_s)
    bench.server.imu.heading_deg += 2.0
    assert bench.session.state == "connecting"  # a gap in the network is not a restart
    bench.speaks = True
    bench.run(2.0)
    way_m = bench.server.chassis.way_m
    assert "restart the server" in bench.try_command(0.3, 0.0)
    bench.command(0.3, 0.0, 5.0)
    assert bench.server.chassis.way_m == way_m
    bench.server.restart(boot_s)
    bench.run(boot_s + 5.0)
    bench.command(0.3, 0.0, 3.0)
    assert not bench.robot.stands


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("delay_s", [0.05, 0.3])
def test_a_lost_server_is_recognised_although_the_network_reorders_its_replies(
    delay_s: float, seed: int
) -> None:
    """The IMU dies in a motion, the stop port hangs, and later the IMU works again.

    The network reorders the late replies. The driver knows that the server is lost, and refuses
    motion.
    """
    bench = outlived("source", (0.3, 0.1), delay_s, seed)
    way_m = bench.server.chassis.way_m
    assert "restart the server" in bench.try_command(0.3, 0.0)
    bench.command(0.3, 0.0, 5.0)
    assert bench.server.chassis.way_m == way_m


@pytest.mark.parametrize(
    ("met", "wait_s", "delay_s"),
    [(b"RM 30", 3.0, 0.0), (b"RM 30", 5.0, 0.0), (b"RM 30", 5.0, 0.05), (b"B SLOW", 5.0, 0.0)],
)
def test_a_driver_that_finds_a_hung_server_does_not_drive_it(
    met: bytes, wait_s: float, delay_s: float
) -> None:
    """The driver starts while the robot moves with a dead IMU.

    The driver's stops make both ports hang. After ``wait_s`` seconds, the IMU works again, but the
    stop port still hangs. The driver refuses motion.
    """
    bench = MartBench("source", NetworkFaults(delay_s=delay_s))
    bench.server.receive(met, 0, None, 0.0)
    bench.run(2.0)
    bench.server.imu.alive = False
    bench.run(0.3)
    bench.open()
    bench.run(wait_s)
    bench.server.imu.alive = True
    bench.run(6.0)
    assert bench.session.state == "nominal"
    assert bench.robot.board.facts["stop_port_hung"]
    assert "restart the server" in bench.try_command(0.3, 0.0)
    bench.command(0.3, 0.0, 5.0)
    assert bench.robot.stands


def test_a_reopened_port_does_not_end_the_refusal_of_a_server_whose_stop_port_hangs() -> None:
    """After the port has opened again, a server with a hung stop port still gets no motion.

    After a restart of the server, the driver accepts motions.
    """
    bench = outlived("source", (0.3, 0.1))
    bench.session.closed(bench.now)
    bench.run(1.0)
    bench.open()
    bench.run(5.0)
    assert bench.session.state == "nominal"
    assert "restart the server" in bench.try_command(0.3, 0.0)
    bench.server.restart(0.3)
    bench.run(5.0)
    assert bench.try_command(0.3, 0.0) == ""


@pytest.mark.parametrize("offset_s", [0.0, 0.03, 0.06, 0.5, 0.7])
def test_a_server_that_has_stood_still_for_five_seconds_is_driven_again(offset_s: float) -> None:
    """While the robot rests, the server's process stands still for 5 s.

    The server then answers late, and the driver accepts commands again.
    """
    bench = MartBench("source").ready()
    bench.command(0.3, 0.3, 2.0)
    bench.command(0.0, 0.0, 2.0)
    bench.run(offset_s)
    advance = bench.robot.advance
    bench.robot.advance = lambda: []
    bench.run(5.0)
    assert b"SL" in bench.said()
    bench.robot.advance = advance
    bench.run(5.0)
    assert bench.try_command(0.3, 0.0) == ""
    bench.command(0.3, 0.0, 3.0)
    assert not bench.robot.stands


def met_in_a_pivot(firmware: Firmware, away_s: float) -> MartBench:
    """Return a test bench whose driver starts while RM turns the robot about its right wheel.

    For the first ``away_s`` seconds, the network loses everything, so the driver finally uses the
    stop port.
    """
    bench = MartBench(firmware)
    bench.server.receive(b"RM 30", 0, None, 0.0)
    bench.run(0.7)
    bench.server.receive(b"RMCS -30 0", 0, None, bench.robot.board.now_s)
    bench.run(1.0)
    bench.hears = bench.speaks = False
    bench.open()
    bench.run(away_s)
    bench.hears = bench.speaks = True
    return bench


@pytest.mark.parametrize("firmware", ["firmware", "source"])
@pytest.mark.parametrize("away_s", [4.0, 6.0])
def test_a_robot_whose_right_wheel_stands_is_stopped_if_the_left_wheel_may_turn(
    away_s: float, firmware: Firmware
) -> None:
    """A robot turns about its resting right wheel, the only wheel with an encoder.

    The left wheel may turn, so the driver stops the robot. A notice says that the right wheel is at
    rest.
    """
    bench = met_in_a_pivot(firmware, away_s)
    assert abs(bench.robot.board.facts["yaw_rate_radps"]) > 0.5
    bench.run(4.0)
    assert bench.robot.stands
    assert any("the right wheel is at rest" in notice for notice in bench.notices)


def test_the_e_stop_stops_a_robot_while_the_driver_asks_what_moves() -> None:
    """The network is back, and the driver asks the server which motion is in progress.

    The e-stop does not wait for the result: the driver uses the stop port at once.
    """
    bench = met_in_a_pivot("firmware", 4.0)
    bench.run(0.5)
    assert "asking the server" in bench.board._pilot.state.value
    said = len(bench.written)
    bench.estop(True)
    bench.run(0.02)
    assert bench.said(said)[:2] == [b"SL", b"SS"]
    assert bench.until_it_stands(1.0) < 0.5


def test_the_e_stop_repeats_the_stop_of_a_lost_server_at_once() -> None:
    """A server hangs in SRM, the stop of a forward drive. After an e-stop, SRM is repeated at once.

    Without an e-stop, the driver repeats SRM once a second.
    """
    bench = MartBench("source").ready()
    bench.command(0.3, 0.1, 2.5)
    bench.server.imu.alive = False
    bench.command(0.3, 0.1, 3.0)
    bench.run_until(lambda: bench.session.board._pilot.state.value.startswith("lost"), 10.0)
    bench.run(0.5)
    said = len(bench.written)
    bench.estop(True)
    bench.run(0.02)
    assert bench.said(said)[:1] == [b"SRM"]


@pytest.mark.parametrize("motion", [(0.3, 0.0), (-0.2, 0.0), (0.0, 0.5)])
def test_a_server_that_is_lost_in_a_drive_is_reported_after_one_and_a_half_seconds(
    motion: tuple[float, float],
) -> None:
    """If the network is cut in a drive, the state is ``connecting`` 1.5 s after the last reply.

    A stop that the driver sends in this time does not delay the change of state.
    """
    bench = MartBench("source").ready()
    bench.command(*motion, 2.0)
    bench.hears = bench.speaks = False
    bench.command(*motion, 1.7)
    assert bench.session.state == "connecting"
