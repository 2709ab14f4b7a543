# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of a wheel that is stuck in a turn, in a drive or in a controlled move.

The controller counts only the right wheel, and measures turns by the gyro.
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
    """If a wheel gets stuck in a turn to a goal, the driver discards the goal.

    The covariance covers the difference between the angles of the encoder and of the gyro.
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
    """The left wheel is stuck in a turn, and only the right wheel has an encoder.

    The driver reports the stuck wheel, and the covariance covers the error of the turn.
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
    """After three failed starts, a motion with a stuck right wheel is refused.

    The refusal lasts until the command ends. A new command moves the robot when the wheel is free.
    """
    bench = MartBench("source").ready()
    bench.server.chassis.change(stuck="right")
    bench.command(vx, yaw_rate, 10.0)
    assert sum("start timedout" in notice for notice in bench.notices) == 3
    assert "refused until the command is zero or expires" in bench.notices[-1]
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
    """If the right wheel gets stuck in a drive, the covariance covers the unmeasured turn."""
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
    """If a wheel gets stuck in a straight move, the covariance covers the unknown turn.

    The server reports only a failure.
    """
    bench = MartBench("source").ready()
    bench.go_to(x_m, 0.0, 0.0)
    bench.run(first_s)
    bench.server.chassis.change(stuck=stuck)
    bench.run(15.0)
    assert any("controlled move failed" in notice for notice in bench.notices)
    assert nees(bench) < MOST_NEES
