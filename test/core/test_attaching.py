# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of how odometry finds its initial heading, and how it uses the board's poses."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import headings, small_moves
from synthetic_board import (
    PERIOD_S,
    SETTINGS,
    Trip,
    attach,
    close,
    earth,
    heading,
    last,
    xyyaw,
)

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.odometry.covariance import Covariance
from omnibot_driver.core.odometry.estimator import Odometry
from omnibot_driver.core.readings import PoseReading


@given(st.lists(small_moves, min_size=1, max_size=5), headings)
def test_deltas_before_the_first_pose_wait_for_it(moves: list[Pose], initial: float) -> None:
    """Deltas that arrive before the board's first pose wait for it.

    When the pose arrives, they are published as if the pose had come first.
    """
    odometry, trip = Odometry(SETTINGS), Trip(initial)
    for move in moves:
        assert odometry.displace(trip.move(*xyyaw(move)), 0.0) == []
    estimates = attach(odometry, trip.pose)
    assert len(estimates) == len(moves)
    assert last(estimates) == close(trip.truth, 1e-8)
    assert not odometry.heading_assumed


@pytest.mark.parametrize("frame", ["earth", "body"])
@pytest.mark.parametrize("turn", [0.0, 0.02, -0.08])
@pytest.mark.parametrize("lost", [(6,), (5, 6), (2,), (1, 3, 6)])
def test_what_is_lost_before_the_first_poses_agree_is_not_taken_back(
    lost: tuple[int, ...], turn: float, frame: str
) -> None:
    """The driver starts while the robot moves, and loses displacements until two poses agree.

    The odometry keeps its estimate of the lost motion, and agrees with all later poses.
    """
    odometry, trip, missing, estimates = Odometry(SETTINGS), Trip(0.7), 0, []
    for number in range(60):
        reading = trip.move(0.02, 0.004, turn, frame)
        if number in lost:
            missing += 1
        else:
            estimates += odometry.displace(replace(reading, lost=missing), number * PERIOD_S)
            missing = 0
        if number % 5 == 4:
            estimates += odometry.settle(trip.pose)
    assert last(estimates) == close(trip.truth, 1e-6)
    assert odometry.refused_poses == 0


def test_a_damaged_pose_leaves_no_error_when_its_count_makes_the_next_one_look_restarted() -> None:
    """A damaged pose puts an error into odom. The next pose seems to show a restart.

    This next pose lies where the odometry expects it, and removes the error.
    """
    odometry, trip, estimates = Odometry(SETTINGS), Trip(), []
    for number in range(30):
        estimates += odometry.displace(trip.move(0.01, 0.0, 0.0), number * PERIOD_S)
        if number % 5 == 4:
            pose = trip.pose
            if number == 14:
                pose = replace(pose, y_m=pose.y_m + 0.015, yaw_rad=pose.yaw_rad + 0.04)
            estimates += odometry.settle(replace(pose, restarted=number == 19))
    assert last(estimates) == close(trip.truth, 1e-3)


def test_the_first_pose_must_be_confirmed_too() -> None:
    """The board's first pose is damaged.

    The odometry does not use the heading of this pose, because two poses must agree.
    """
    odometry = Odometry(SETTINGS)
    assert odometry.displace(earth(0.0, 0.1), 0.0) == []
    assert odometry.settle(heading(-1.0)) == []
    assert odometry.displace(earth(0.0, 0.1), 0.0) == []
    assert odometry.settle(PoseReading(1.0, 2.1, math.pi / 2)) == []
    assert odometry.displace(earth(0.0, 0.1), 0.0) == []
    estimates = odometry.settle(PoseReading(1.0, 2.2, math.pi / 2))
    assert len(estimates) == 3
    assert last(estimates) == close((0.3, 0.0, 0.0))
    assert odometry.refused_poses == 1


def test_a_board_that_was_paused_leaves_no_doubt_where_the_odometry_begins() -> None:
    """The board was paused, so the duration of the first displacement is unknown.

    Nevertheless, the first odometry has a covariance of zero, because odom begins there.
    """
    odometry, trip = Odometry(SETTINGS), Trip(1.0)
    odometry.displace(replace(trip.move(0.0, 0.0, 0.0), duration_s=None), 0.0)
    assert attach(odometry, trip.pose)[-1].covariance == Covariance()


def test_a_single_pose_in_the_first_second_is_better_than_none() -> None:
    """The odometry usually waits until two poses agree. Here, the board's second pose is lost.

    After a second without another pose, the odometry accepts the first one.
    """
    odometry = Odometry(SETTINGS)
    odometry.settle(heading(math.pi / 2))
    for _ in range(25):
        estimates = odometry.displace(earth(0.0, 0.01), 0.0)
    assert last(estimates) == close((0.25, 0.0, 0.0))
    assert not odometry.heading_assumed


def test_without_a_pose_heading_0_is_assumed_after_a_second_of_deltas() -> None:
    """The board sends no pose. After a second, the odometry assumes heading 0.

    Then it publishes the 25 deltas that have waited, all together. It publishes each later delta
    immediately.
    """
    odometry = Odometry(SETTINGS)
    for _ in range(24):
        assert odometry.displace(earth(0.01, 0.0), 0.0) == []
    assert not odometry.heading_assumed
    estimates = odometry.displace(earth(0.01, 0.0), 0.0)
    assert odometry.heading_assumed
    assert len(estimates) == 25
    assert last(estimates) == close((0.25, 0.0, 0.0))
    assert last(odometry.displace(earth(0.0, 0.01), 0.0)) == close((0.25, 0.01, 0.0))


def test_a_pose_that_comes_after_all_is_believed_when_confirmed() -> None:
    """For 1 s, the board sends no pose, so the odometry assumes heading 0.

    Then two equal poses come. The odometry uses their heading for later motion, and odom does not
    jump.
    """
    odometry = Odometry(SETTINGS)
    for _ in range(25):
        odometry.displace(earth(0.0, 0.0), 0.0)
    attach(odometry, heading(math.pi / 2))
    odometry.settle(heading(math.pi / 2))
    assert last(odometry.displace(earth(0.0, 0.1), 0.0)) == close((0.1, 0.0, 0.0))


@given(st.floats(0.15, 6.1), headings)
def test_a_surprising_pose_must_be_confirmed(surprise: float, initial: float) -> None:
    """One pose with an unexpected heading changes nothing.

    Two such poses in a row show that the board's coordinate frame has changed. Odom then continues
    without a jump.
    """
    odometry, trip = Odometry(SETTINGS), Trip(initial)
    attach(odometry, trip.pose)
    x, y, yaw = trip.board
    odometry.settle(PoseReading(x, y, yaw + surprise))
    assert last(odometry.displace(trip.move(0.1, 0.0, 0.0), 0.0)) == close((0.1, 0.0, 0.0))
    odometry.settle(trip.pose)
    assert last(odometry.displace(trip.move(0.1, 0.0, 0.0), 0.0)) == close((0.2, 0.0, 0.0))
    trip.board = (500.0, 600.0, initial + surprise)
    odometry.settle(trip.pose)
    odometry.settle(trip.pose)
    assert last(odometry.displace(trip.move(0.1, 0.0, 0.0), 0.0)) == close((0.3, 0.0, 0.0))


def test_two_surprising_poses_that_disagree_confirm_nothing() -> None:
    """Damaged poses with different headings do not confirm each other."""
    odometry = Odometry(SETTINGS)
    attach(odometry, heading(0.0))
    for yaw in (1.0, 2.0, -1.0):
        odometry.settle(heading(yaw))
    assert last(odometry.displace(earth(1.0, 0.0), 0.0)) == close((1.0, 0.0, 0.0))


def test_a_board_that_counts_its_heading_modulo_a_turn_surprises_nobody() -> None:
    """A step of the board's heading from +π to −π is not a jump."""
    odometry = Odometry(SETTINGS)
    attach(odometry, heading(math.pi - 0.01))
    odometry.displace(earth(0.0, 0.0, 0.02), 0.0)
    odometry.settle(heading(-math.pi + 0.01))
    ahead = earth(math.cos(-math.pi + 0.01), math.sin(-math.pi + 0.01))
    assert last(odometry.displace(ahead, 0.0)) == close((math.cos(0.02), math.sin(0.02), 0.02))


def test_small_errors_of_the_summed_displacements_are_corrected_by_each_pose() -> None:
    """Because of rounding, the sum of the displacements differs from the board's pose.

    The error is corrected in five steps, one with each of the next displacements.
    """
    odometry = Odometry(SETTINGS)
    attach(odometry, PoseReading(0.0, 0.0, 0.0))
    odometry.settle(PoseReading(0.01, -0.005, 0.02))
    ways = [last(odometry.displace(earth(0.0, 0.0), 0.0)) for _ in range(5)]
    assert ways[0] == close((0.002, -0.001, 0.004))
    assert ways[4] == close((0.01, -0.005, 0.02))


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_pose_that_is_not_finite_is_ignored(bad: float) -> None:
    """A pose with NaN or infinity is ignored, before the first valid pose and after it."""
    odometry = Odometry(SETTINGS)
    odometry.displace(earth(0.0, 0.1), 0.0)
    assert odometry.settle(PoseReading(0.0, 0.0, bad)) == []
    assert len(attach(odometry, heading(math.pi / 2))) == 1
    odometry.settle(PoseReading(0.0, 0.0, bad))
    odometry.settle(PoseReading(0.0, 0.0, bad))
    assert last(odometry.displace(earth(0.0, 0.1), 0.0)) == close((0.2, 0.0, 0.0))


def test_the_heading_is_known_while_poses_of_the_board_say_it() -> None:
    """The heading is known once two poses agree, and unknown after a gap of 20 displacements.

    Without any pose, the heading is unknown.
    """
    odometry = Odometry(SETTINGS)
    assert not odometry.heading_known
    attach(odometry, heading(1.0))
    assert odometry.heading_known
    odometry.displace(replace(earth(0.01, 0.0), lost=3), 0.0)
    assert odometry.heading_known
    odometry.displace(replace(earth(0.01, 0.0), lost=20), 0.0)
    assert not odometry.heading_known
    assumed = Odometry(SETTINGS)
    for _ in range(30):
        assumed.displace(earth(0.01, 0.0), 0.0)
    assert not assumed.heading_known
