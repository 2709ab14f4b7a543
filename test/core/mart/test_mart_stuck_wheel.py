# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of a wheel that is stuck in a turn, in a drive or in a controlled move.

The controller reports the encoder count of the right wheel only. It measures the angle of a turn by
the gyro.
"""

import math

import pytest
from honesty import nees
from mart_bench import MartBench

from omnibot_driver.simulator.mart.settings import Stuck

WHEELS = pytest.mark.parametrize("stuck", ["left", "right"])
MOST_NEES = 16.3
"""If the covariance is right, NEES exceeds this value in one of 1000 drives."""


@pytest.mark.slow
@WHEELS
@pytest.mark.parametrize("first_s", [0.5, 1.0])
def test_a_wheel_that_gets_stuck_in_a_turn_to_a_goal_discards_it(
    stuck: Stuck, first_s: float
) -> None:
    """A wheel gets stuck during a turn to a goal. The server measures the turn only by the gyro.

    The encoder of the right wheel shows another angle than the gyro, so the driver discards the
    goal. The covariance of the pose covers the difference between the two angles.
    """
    bench = MartBench("source").ready()
    bench.go_to(0.0, 0.0, 2.6)
    bench.run(first_s)
    bench.server.chassis.change(stuck=stuck)
    bench.run(15.0)
    (notice,) = bench.notices
    assert "one wheel may be stuck" in notice
    assert "the goal of cmd_pose is discarded" in notice
    assert bench.board._pilot.goal_progress == "none"
    assert abs(bench.truth.yaw_rad) < 2.8
    assert nees(bench) < MOST_NEES


@pytest.mark.parametrize("first_s", [0.0, 2.0])
def test_a_left_wheel_that_is_stuck_in_a_turn_is_reported(first_s: float) -> None:
    """The left wheel is stuck in a turn, so the right wheel turns twice as far for the same angle.

    The server's reply to the stop contains the true angle. The driver computes another angle from
    the right wheel. It reports the difference between the two angles, and the covariance covers it.
    """
    bench = MartBench("source").ready()
    bench.command(0.0, 0.6, first_s)
    bench.server.chassis.change(stuck="left")
    bench.command(0.0, 0.6, 8.0)
    bench.command(0.0, 0.0, 3.0)
    assert any("one wheel may be stuck" in notice for notice in bench.notices)
    assert nees(bench) < MOST_NEES


@pytest.mark.slow
@pytest.mark.parametrize(("vx", "yaw_rate"), [(0.0, 0.6), (0.0, -0.6), (-0.3, 0.0)])
def test_starts_that_do_not_turn_the_right_wheel_are_not_repeated_without_end(
    vx: float, yaw_rate: float
) -> None:
    """The right wheel is stuck. At each start, only the left wheel turns, and the start fails.

    After three starts, the driver refuses this motion until the user's command ends. When the wheel
    is free, a new command moves the robot again.
    """
    bench = MartBench("source").ready()
    bench.server.chassis.change(stuck="right")
    bench.command(vx, yaw_rate, 10.0)
    assert sum("start timedout" in notice for notice in bench.notices) == 3
    assert "refused until the command ends" in bench.notices[-1]
    assert abs(bench.truth.yaw_rad) < math.radians(90.0)
    assert nees(bench) < MOST_NEES
    bench.command(0.0, 0.0, 3.0)
    bench.server.chassis.change(stuck="none")
    refused_at = bench.truth
    bench.command(vx, yaw_rate, 3.0)
    moved = refused_at.way_to(bench.truth)
    assert moved.way_m + abs(moved.yaw_rad) > 0.3


@pytest.mark.parametrize(("vx", "first_s"), [(0.3, 2.0), (-0.3, 1.0)])
def test_a_right_wheel_that_gets_stuck_in_a_drive_makes_the_heading_uncertain(
    vx: float, first_s: float
) -> None:
    """The right wheel gets stuck in a drive, so the left wheel turns the robot.

    This turn ends when the driver notices that a wheel is stuck. The driver cannot measure the
    whole turn, so the covariance must cover the error of the pose.
    """
    bench = MartBench("source").ready()
    bench.command(vx, 0.0, first_s)
    bench.server.chassis.change(stuck="right")
    bench.command(vx, 0.0, 3.0)
    bench.command(0.0, 0.0, 3.0)
    assert abs(bench.truth.yaw_rad) > math.radians(10.0)
    assert nees(bench) < MOST_NEES


@pytest.mark.slow
@WHEELS
@pytest.mark.parametrize(("x_m", "first_s"), [(2.0, 0.8), (2.0, 2.5), (-2.0, 4.0)])
def test_a_wheel_that_gets_stuck_in_a_straight_move_makes_the_heading_uncertain(
    stuck: Stuck, x_m: float, first_s: float
) -> None:
    """A wheel gets stuck in a straight move, so the robot turns. The server reports only a failure.

    The driver does not know how far the robot has turned. The covariance covers the error.
    """
    bench = MartBench("source").ready()
    bench.go_to(x_m, 0.0, 0.0)
    bench.run(first_s)
    bench.server.chassis.change(stuck=stuck)
    bench.run(15.0)
    assert any("controlled move failed" in notice for notice in bench.notices)
    assert nees(bench) < MOST_NEES
