# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of motors, or of a direct control by MCS, that an earlier driver has left on."""

import pytest
from creeping_robot import BOTH, OFF, creeping, registers
from mart_bench import MartBench
from mart_goals import drops

from omnibot_driver.core.mart import MartSettings as Settings

pytestmark = pytest.mark.slow


def test_the_guard_releases_a_server_whose_driver_dies_in_a_switch_off() -> None:
    """The driver dies while the motors are under direct control (MCS).

    The stop commands of its guard include MSM, which ends the direct control.
    """
    bench = creeping()
    bench.run_until(lambda: bench.server.manual, 0.3)
    assert (0, b"MSM") in bench.board.stop()
    bench.run(1.0)
    assert (0, b"MSM") not in bench.board.stop()


@pytest.mark.parametrize("away_s", [0.0, 8.0])
def test_a_driver_releases_a_server_that_another_one_has_left_in_a_switch_off(
    away_s: float,
) -> None:
    """A new driver sends MSM to end the direct control (MCS) that an earlier driver has left on.

    The robot then drives, even if the network fails at first.
    """
    bench = MartBench("source")
    bench.server.receive(BOTH[0], 0, None, 0.0)
    bench.run(0.1)
    assert bench.server.manual
    lost = drops(bench.robot.network[0].to_board, lambda _: bench.now < began_s + away_s)
    drops(bench.robot.network[1].to_board, lambda _: bench.now < began_s + away_s)
    began_s = bench.now
    bench.open()
    bench.run(away_s)
    assert bool(lost) == bool(away_s)
    bench.run_until(lambda: bench.session.state == "nominal", 30.0)
    bench.run(2.0)
    for _ in range(3):
        bench.command(0.2, 0.0, 2.0)
        bench.run(1.5)
    assert not bench.server.manual
    assert bench.truth.way_m > 0.3


def test_a_driver_that_begins_switches_the_motors_off() -> None:
    """An earlier driver was killed directly after a straight move, so a motor may be on.

    The new driver switches the motors off (MCS, MSM).
    """
    bench = MartBench("source")
    bench.server.drive(128, 127)
    bench.ready()
    assert registers(bench) == OFF
    assert not bench.server.manual
    assert [each for each in bench.said() if each in BOTH] == BOTH


def test_a_copy_of_the_release_reply_is_not_taken_for_the_check_of_the_imu() -> None:
    """RST IMU (IMU check) is lost, and a copy of the reply to MSM (end of direct control) arrives.

    The copy does not count as the reply to RST IMU; otherwise, SRM (stop) would hang the server.
    """
    bench = MartBench("source", settings=Settings(network_delay_s=0.5))
    bench.server.receive(b"RM 30", 0, None, 0.0)
    bench.run(0.5)
    began_s = bench.now
    to_board, from_board = bench.robot.network[0].to_board, bench.robot.network[0].from_board
    released_s = list[float]()
    send = from_board.send

    def doubles(data: bytes, at_s: float) -> None:
        send(data, at_s)
        if data == b"ok" and bench.said()[-1] == b"MSM":
            released_s.append(bench.now)
            send(data, at_s + 0.45)

    from_board.send = doubles
    drops(
        to_board,
        lambda data: (
            bench.now < began_s + 4.0
            or (data == b"RST IMU" and bool(released_s) and bench.now < released_s[0] + 1.0)
        ),
    )
    bench.open()
    bench.run(15.0)
    assert released_s
    assert any("still reports a motion" in text for text in bench.notices)
    assert not bench.server.hung
