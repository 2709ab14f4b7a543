# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that no motor stays on after a straight move, whose end the public server can miss.

In the sample in which the move ends, the server corrects the heading once more. That writes a unit
to a motor that it has just switched off.
"""

import pytest
from mart_bench import MartBench
from mart_goals import drops, reach

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.mart.jobs import Job
from omnibot_driver.core.mart.states import Motion

pytestmark = pytest.mark.slow

OFF = (128, 128)


def registers(bench: MartBench) -> tuple[int, int]:
    return bench.server.chassis.right, bench.server.chassis.left


def creeping() -> MartBench:
    """Return a bench whose robot has just driven straight, and whose left motor is still on."""
    bench = MartBench("source").ready()
    bench.robot._good = False
    bench.go_to(0.5, 0.0, 0.0)
    pilot = bench.board._pilot
    bench.run_until(lambda: pilot.motion is Motion.STRAIGHT, 10.0)
    bench.run_until(lambda: pilot.motion is Motion.NONE, 10.0)
    bench.server.drive(128, 127)
    return bench


def test_a_motor_that_the_server_has_left_on_is_switched_off() -> None:
    """The driver sends RM 0, once, and reports nothing."""
    bench = creeping()
    since, events = len(bench.written), len(bench.notices)
    bench.run(2.0)
    assert registers(bench) == OFF
    assert bench.said(since).count(b"RM 0") == 1
    assert len(bench.notices) == events
    assert bench.error.way_m < 0.05


def test_a_switch_off_that_is_lost_is_sent_again() -> None:
    """The network loses the first RM 0. The driver misses its reply, and repeats it."""
    bench = creeping()
    since = len(bench.written)
    path = bench.robot.network[0].to_board
    lost = drops(path, lambda data: data == b"RM 0" and bench.said(since).count(data) == 1)
    bench.run(6.0)
    assert lost == [b"RM 0"]
    assert bench.said(since).count(b"RM 0") == 2
    assert registers(bench) == OFF


def test_an_estop_after_a_drive_switches_the_motor_off_too() -> None:
    """The e-stop is latched before RM 0 was sent. RM 0 follows once, and the stops continue."""
    bench = creeping()
    since = len(bench.written)
    bench.estop(True)
    bench.run(3.0)
    assert registers(bench) == OFF
    assert bench.said(since).count(b"RM 0") == 1
    mark = len(bench.written)
    bench.run(1.0)
    assert bench.said(mark).count(b"SRM") >= 5


def test_a_motor_is_not_switched_off_with_a_dead_imu() -> None:
    """With a dead IMU, RM would hang the server. So the driver does not send it."""
    bench = creeping()
    bench.robot.board.server.imu.alive = False
    since = len(bench.written)
    bench.run(5.0)
    assert b"RM 0" not in bench.said(since)


def test_a_goal_that_ends_with_a_turn_needs_no_switch_off() -> None:
    """A controlled turn writes both motors, and leaves them off."""
    bench = MartBench("source").ready()
    reach(bench, Pose(0.5, 0.0, 1.5))
    bench.run(2.0)
    assert bench.said()[-2].startswith(b"MCL")
    assert b"RM 0" not in bench.said()


def test_a_docking_move_is_followed_by_a_switch_off() -> None:
    """A docking drives straight too."""
    bench = MartBench("source", dock_m=0.4).ready()
    bench.job(Job.DOCK, "DOCK", 12)
    bench.run(2.0)
    assert bench.said()[-2:] == [b"RM 0", b"SRM"]
