# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of odometry across lost frames, with the simulated board."""

import math
from functools import cache
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lossy_drives import (
    PERIOD_S,
    attached,
    line,
    lose,
    settled,
    steps,
)
from lossy_odometry import DELTA, POSE, Line, loses_nothing

from omnibot_driver.core.odometry.estimate import OdometryEstimate, OdometrySettings
from omnibot_driver.core.odometry.estimator import Odometry
from omnibot_driver.core.readings import DisplacementReading, PoseReading


@cache
def over_a_gap(lost: int, seed: int, frame: str) -> tuple[Line, list[OdometryEstimate]]:
    """Return a simulated line, 1 s after a gap of ``lost`` deltas, and its odometry estimates.

    The first estimate is the last one before the gap. All others are from after the gap.
    """
    on = line(seed, frame=frame)
    before = on.estimates[-1]
    lose(on, lost * PERIOD_S)
    return on, [before, *on.run(1.0)]


@pytest.mark.slow
@pytest.mark.parametrize("lost", [1, 2, 3, 5, 10, 25, 60, 100, 250, 300, 2600])
@pytest.mark.parametrize("frame", ["earth", "body"])
def test_a_second_after_any_gap_odom_is_the_boards_own_pose_again(lost: int, frame: str) -> None:
    """Up to 2600 deltas are lost, perhaps in a curve. The counters may wrap in the gap.

    After 1 s, odom is the board's own pose again.
    """
    for seed in range(5 if lost < 60 else 2 if lost < 2600 else 1):
        on, _ = over_a_gap(lost, seed, frame)
        assert settled(on), on.error


def test_a_short_gap_is_bridged_at_once() -> None:
    """After a gap of 0.12 s, odom is right within 2 mm and 2 mrad with the next delta.

    The motion in the gap is interpolated.
    """
    for seed in range(5):
        on = line(seed)
        lose(on, 0.12)
        on.run(PERIOD_S)
        assert on.error.way_m < 0.002
        assert abs(on.error.yaw_rad) < 0.002


def test_lost_poses_alone_cost_nothing_but_rounding() -> None:
    """For ten seconds no pose arrives. Odometry from deltas alone is right within 5 mm."""
    on = line(1)
    lose(on, 10.0, POSE)
    assert on.error.way_m < 0.005
    on.run(0.4)
    assert settled(on)


@pytest.mark.slow
@pytest.mark.parametrize("rate", [0.01, 0.1, 0.3])
def test_while_frames_are_lost_at_random_odom_stays_near_and_settles(rate: float) -> None:
    """In 30 s of losses, the error is below 0.1 m. After 1 s without losses, it is gone."""
    random, on = Random(0), line(0)
    on.loses = lambda _data, _now: random.random() < rate
    for _ in range(150):
        on.run(0.2)
        assert on.error.way_m < 0.1
    on.loses = loses_nothing
    on.run(1.0)
    assert settled(on)


@pytest.mark.slow
@pytest.mark.parametrize("lost", [1, 5, 10, 25, 26, 60, 100, 250])
@pytest.mark.parametrize("frame", ["earth", "body"])
def test_no_step_is_larger_than_the_robot_could_have_moved(lost: int, frame: str) -> None:
    """After a gap, no step from one odom message to the next is faster than 2 m/s or 8 rad/s.

    The first step contains the motion of the gap and of the next delta.
    """
    for seed in range(5 if lost < 60 else 2):
        _, estimates = over_a_gap(lost, seed, frame)
        after = steps(estimates)
        assert after[0][0] > lost * PERIOD_S
        for seconds, step in after:
            assert step.way_m <= 2.0 * seconds + 1e-6
            assert abs(step.yaw_rad) <= 8.0 * seconds + 1e-6


def test_a_bridge_that_was_far_wrong_is_put_right_at_the_fastest_speed_and_no_faster() -> None:
    """The robot reverses in a gap, so the interpolated pose is wrong by 0.5 m.

    Odom is corrected at the fastest possible speed of a robot, 2 m/s.
    """
    odometry, x, stamp_s = attached(), 0.0, 0.0
    estimates: list[OdometryEstimate] = []

    def drive(step: float, lost: int, told: bool) -> None:
        nonlocal x, stamp_s
        x, stamp_s = x + step, stamp_s + (lost + 1) * PERIOD_S
        reading = DisplacementReading(step, 0.0, 0.0, "earth", PERIOD_S, lost)
        estimates.extend(odometry.displace(reading, stamp_s))
        if told:
            odometry.settle(PoseReading(x, 0.0, 0.0))

    for number in range(10):
        drive(0.01, 0, number % 5 == 4)
    x -= 0.5
    drive(-0.01, 25, True)
    for number in range(25):
        drive(-0.01, 0, number % 5 == 4)
    moves = steps(estimates)
    assert max(step.way_m / seconds for seconds, step in moves) == pytest.approx(2.0)
    assert estimates[-1].pose.x_m == pytest.approx(x, abs=1e-9)


def test_the_twist_is_that_of_the_last_displacement_whatever_is_put_right() -> None:
    """After a gap the pose is corrected. The correction does not appear in the twist."""
    on = line(3)
    lose(on, 1.0)
    twists = [estimate.twist for estimate in on.run(1.0)]
    assert all(twist is not None for twist in twists)
    assert max(math.hypot(twist.vx_mps, twist.vy_mps) for twist in twists if twist) < 0.7


@pytest.mark.parametrize("lost", [2, 5, 10])
def test_the_covariance_jumps_with_a_gap_and_shrinks_when_it_is_settled(lost: int) -> None:
    """Frames are lost, so the covariance grows. The next pose of the board reduces it again.

    The covariance is then that of a drive without losses.
    """
    whole, torn = line(2), line(2)
    whole.run(lost * PERIOD_S)
    lose(torn, lost * PERIOD_S)
    (first,) = torn.run(PERIOD_S)
    (same,) = whole.run(PERIOD_S)
    assert first.covariance.xx > same.covariance.xx * 1.001
    assert first.covariance.yaw_yaw > same.covariance.yaw_yaw * 1.001
    last_torn, last_whole = torn.run(1.0)[-1].covariance, whole.run(1.0)[-1].covariance
    assert last_torn.xx == pytest.approx(last_whole.xx, rel=0.05)
    assert last_torn.yaw_yaw == pytest.approx(last_whole.yaw_yaw, rel=0.05)


def test_without_the_boards_pose_gaps_are_bridged_and_stay_open() -> None:
    """With ``use_board_pose`` off, the board's pose does not correct the error of a gap.

    The gap is interpolated, and its error and covariance stay.
    """
    on = line(1, OdometrySettings(use_board_pose=False))
    lose(on, 0.4)
    (first,) = on.run(PERIOD_S)
    off = on.error
    assert off.way_m < 0.02
    last = on.run(1.0)[-1]
    assert on.error.way_m == pytest.approx(off.way_m, abs=0.005)
    assert last.covariance.xx > first.covariance.xx


@pytest.mark.parametrize("use_board_pose", [True, False])
@pytest.mark.parametrize("phase", range(5))
def test_a_gap_that_ends_with_a_pose_is_bridged_once(phase: int, use_board_pose: bool) -> None:
    """Deltas are lost. The next pose includes their motion, which the odometry adds.

    Then the counter of the next delta shows the loss. The odometry does not add the motion again.
    """
    on = line(0, OdometrySettings(use_board_pose=use_board_pose))
    on.run(phase * PERIOD_S)
    lose(on, 2 * PERIOD_S, DELTA)
    for _ in range(10):
        on.run(PERIOD_S)
        assert on.error.way_m < 0.005, on.error


def test_a_board_that_sends_no_pose_is_bridged() -> None:
    """The board sends no poses, and frames are lost. The odometry interpolates the gap.

    At constant speed in a constant curve, the interpolation is exact.
    """
    odometry = Odometry(OdometrySettings())
    for number in range(60):
        if number < 30 or number >= 40:
            odometry.displace(moved(lost=10 if number == 40 else 0), number * PERIOD_S)
    (estimate,) = odometry.displace(moved(), 0.0)
    whole = Odometry(OdometrySettings())
    for number in range(61):
        found = whole.displace(moved(), number * PERIOD_S)
    assert estimate.pose.way_to(found[-1].pose).way_m < 1e-9


def moved(lost: int = 0) -> DisplacementReading:
    return DisplacementReading(0.02, 0.01, 0.03, "body", PERIOD_S, lost)


losses = st.lists(st.tuples(st.integers(0, 60), st.integers(0, 7)), max_size=8)
"""Patterns of losses: pairs of the number of frames that arrive and the number lost after them.

Only deltas and poses are counted.
"""


@pytest.mark.slow
@given(losses, st.integers(0, 3), st.sampled_from(["earth", "body"]))
@settings(max_examples=20)
def test_after_any_losses_and_one_good_second_odom_is_the_boards_pose(
    pattern: list[tuple[int, int]], seed: int, frame: str
) -> None:
    """Deltas and poses are lost in any pattern.

    After a second without losses, odom is the board's pose. No step of odom exceeds 2 m/s.
    """
    on = line(seed, frame=frame)
    fate = iter([lost for come, gone in pattern for lost in [False] * come + [True] * gone])
    on.loses = lambda _data, _now: next(fate, False)
    estimates = on.run(sum(come + gone for come, gone in pattern) / 30 + 1.1)
    assert settled(on), on.error
    for seconds, step in steps(estimates):
        assert step.way_m <= 2.0 * seconds + 1e-6
