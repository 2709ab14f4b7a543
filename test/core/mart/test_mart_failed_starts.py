# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of motions whose start fails. The driver repeats some of these starts.

If a server rejects a start but moves the robot, the driver refuses motion.
"""

import pytest
from mart_bench import MartBench

from omnibot_driver.simulator.mart import Firmware, Kind

pytestmark = pytest.mark.slow


def test_an_rm_that_fails_once_after_a_slow_stop_is_tried_again() -> None:
    """After a stop that took 0.56 s to 0.6 s, the server rejects the next forward drive (RM).

    The driver sends RM again.
    """
    bench = MartBench("source").ready()
    bench.server.motions[Kind.REFERENCE].samples = 58
    bench.command(0.3, 0.0, 4.0)
    assert any("RM failed" in notice for notice in bench.notices)
    assert bench.board.refusal == ""
    assert not bench.robot.stands


def test_a_drive_whose_rm_has_failed_once_is_as_fast_as_commanded_two_seconds_after_its_step() -> (
    None
):
    """The server rejects the start of a forward drive. The driver soon sends the start again.

    Two seconds after the command, the speed is right.
    """
    bench = MartBench("source").ready()
    bench.command(0.3, 0.0, 3.0)
    bench.command(0.0, 0.0, 1.0)
    bench.server.motions[Kind.REFERENCE].samples = 58
    bench.command(0.3, 0.0, 2.0)
    assert any("RM failed" in notice for notice in bench.notices)
    from_m = bench.server.chassis.x_m
    bench.command(0.3, 0.0, 2.0)
    assert bench.server.chassis.x_m - from_m == pytest.approx(0.6, rel=0.05)


def test_an_rm_that_failed_before_a_good_one_does_not_make_a_push_a_defect() -> None:
    """The server rejects one RM (forward drive), and obeys the next; later, the robot is pushed.

    The driver allows motion: it does not take the push for a motion by the rejected RM.
    """
    bench = MartBench("source").ready()
    bench.server.motions[Kind.REFERENCE].samples = 58
    bench.command(0.3, 0.0, 1.4)
    assert not bench.robot.stands
    bench.command(0.0, 0.0, 1.0)
    bench.server.receive(b"RM 30", 0, None, bench.robot.board.now_s)
    bench.run(3.0)
    assert any("moves without a command" in notice for notice in bench.notices)
    assert bench.board.refusal == ""


def test_an_rm_that_fails_by_the_obstacle_of_the_last_b_is_tried_again() -> None:
    """The driver repeats RM (forward drive) if the server rejects RM because of an old obstacle.

    The obstacle ended a backward drive, and the front sonar shows no obstacle.
    """
    bench = MartBench("source").ready()
    bench.server.motions[Kind.LINEAR].error = "insufficent clearence"
    bench.server.motions[Kind.REFERENCE].samples = 58
    bench.command(0.3, 0.0, 4.0)
    assert any("RM failed (insufficent clearence)" in notice for notice in bench.notices)
    assert not any("obstacle in front" in notice for notice in bench.notices)
    assert not bench.robot.stands


def test_a_server_whose_rm_fails_although_it_moves_is_stopped_and_refused() -> None:
    """A server rejects RM (forward drive) but moves the robot, and then ignores stop commands.

    The driver switches the motors off, and then refuses motion.
    """
    bench = MartBench(reference_start_fails=True).ready()
    bench.command(0.3, 0.0, 8.0)
    assert bench.robot.stands
    assert bench.server.chassis.way_m < 1.0
    bench.run(10.0)
    assert bench.robot.stands
    assert bench.try_command(0.3, 0.0)


def test_a_push_long_after_an_rm_that_failed_is_not_a_defect_of_the_server() -> None:
    """Somebody pushes the robot five seconds after a rejected RM (forward drive).

    The driver still allows motion. A server that wrongly obeys a rejected RM would have moved the
    robot at once.
    """
    bench = MartBench("source").ready()
    bench.server.motions[Kind.REFERENCE].samples = 58
    bench.command(0.3, 0.0, 0.3)
    bench.command(0.0, 0.0, 5.0)
    assert any("RM failed" in notice for notice in bench.notices)
    bench.server.receive(b"RM 30", 0, None, bench.robot.board.now_s)
    bench.run(5.0)
    assert any("moves without a command" in notice for notice in bench.notices)
    assert bench.try_command(0.3, 0.0) == ""
    bench.command(0.3, 0.0, 3.0)
    assert not bench.robot.stands


def test_a_copy_of_a_start_on_a_network_that_loses_replies_is_not_a_defect_of_the_server() -> None:
    """A late copy of a rejected RM (forward drive) moves the robot, and the network loses replies.

    The driver stops this motion. It does not regard the server as defective, so it allows motion
    later.
    """
    bench = MartBench("source").ready()
    usual = bench.server.motions[Kind.REFERENCE].samples
    bench.server.motions[Kind.REFERENCE].samples = 58
    bench.command(0.3, 0.0, 0.3)
    bench.server.motions[Kind.REFERENCE].samples = usual
    assert any("RM failed" in notice for notice in bench.notices)
    bench.command(0.0, 0.0, 0.6)
    bench.server.receive(b"RM 30", 0, None, bench.robot.board.now_s)
    bench.speaks = False
    bench.command(0.0, 0.0, 0.2)
    bench.speaks = True
    bench.run(6.0)
    assert any("moves without a command" in notice for notice in bench.notices)
    assert bench.robot.stands
    assert bench.try_command(0.3, 0.0) == ""
    bench.command(0.3, 0.0, 3.0)
    assert not bench.robot.stands


@pytest.mark.parametrize("twist", [(0.15, 0.5), (0.05, 0.0), (0.0, 0.3), (-0.05, 0.1)])
@pytest.mark.parametrize(("dead_units", "firmware"), [(8.0, "source"), (10.0, "firmware")])
def test_motors_that_need_many_units_are_started_with_more_after_a_start_that_failed(
    twist: tuple[float, float], dead_units: float, firmware: Firmware
) -> None:
    """The motors need more units to start than the driver assumes, so the first start fails.

    The next start is stronger.
    """
    bench = MartBench(firmware, dead_zone_units=dead_units).ready()
    bench.command(*twist, 6.0)
    assert not bench.robot.stands
    assert not any("stuck" in notice or "IMU" in notice for notice in bench.notices)
    assert len(bench.notices) <= 1
