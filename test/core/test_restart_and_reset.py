# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of how odometry follows a restart of the board, and how it is reset."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import axis_signs, headings, small_moves
from synthetic_board import (
    PERIOD_S,
    SETTINGS,
    Trip,
    attach,
    close,
    earth,
    last,
    xyyaw,
)

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.odometry.covariance import Covariance
from omnibot_driver.core.odometry.estimate import OdometryEstimate
from omnibot_driver.core.odometry.estimator import Odometry
from omnibot_driver.core.readings import PoseReading


def driven(deltas: int, step_m: float) -> tuple[Odometry, list[OdometryEstimate]]:
    """Return an odometry that has followed a straight drive, and its estimates."""
    odometry, estimates = Odometry(SETTINGS), list[OdometryEstimate]()
    for number in range(deltas):
        estimates += odometry.displace(earth(step_m, 0.0), number * PERIOD_S)
        if number % 5 == 4:
            estimates += odometry.settle(PoseReading(step_m * (number + 1), 0.0, 0.0))
    return odometry, estimates


@pytest.mark.parametrize("lost", [20, 25])
def test_a_restart_that_only_the_pose_shows_is_no_motion_in_the_gap(lost: int) -> None:
    """The board restarts in a gap, and only the next pose shows the restart.

    Odom does not jump, although the robot could also have driven to the board's old origin in the
    gap.
    """
    odometry, estimates = driven(75, 0.004)
    before = last(estimates)
    for number in range(75 + lost, 105 + lost):
        still = replace(earth(0.0, 0.0), lost=lost if number == 75 + lost else 0)
        estimates += odometry.displace(still, number * PERIOD_S)
        if number % 5 == lost % 5:
            pose = PoseReading(0.0, 0.0, 0.0, restarted=number < 81 + lost)
            estimates += odometry.settle(pose)
    assert last(estimates) == close(before, 0.06)


def test_a_restart_that_the_pose_shows_after_a_long_gap_leaves_a_small_uncertainty() -> None:
    """If the first pose after a gap of 1.6 s shows a restart, odom keeps its pose.

    The uncertainty of odom is small: only the robot's motion until it came to rest is unknown.
    """
    odometry, estimates = driven(75, 0.014)
    for number in range(115, 120):
        still = replace(earth(0.0, 0.0), lost=40 if number == 115 else 0)
        estimates += odometry.displace(still, number * PERIOD_S)
    estimates += odometry.settle(PoseReading(0.0, 0.0, 0.0, restarted=True))
    assert last(estimates) == close((0.014 * 75, 0.0, 0.0), 0.001)
    assert estimates[-1].covariance.xx < 0.15 * 0.15
    assert estimates[-1].covariance.yaw_yaw < 0.5 * 0.5


@pytest.mark.parametrize(
    ("ambiguous", "told_m", "x_m"),
    [(True, 0.0, 0.3), (True, 0.002, 0.3), (True, 0.01, 0.01), (False, 0.0, 0.0)],
)
def test_a_pose_at_a_new_origin_shows_a_restart_that_the_counters_hide(
    ambiguous: bool, told_m: float, x_m: float
) -> None:
    """After a gap, a board's pose at the origin shows a restart. Odom does not move.

    If the counters exclude a restart, or if the pose is 1 cm from the origin, odom moves to the
    pose.
    """
    odometry, estimates = driven(75, 0.004)
    for number in range(127, 177):
        still = replace(earth(0.0, 0.0), lost=52 if number == 127 else 0)
        estimates += odometry.displace(still, number * PERIOD_S)
        if number % 5 == 1:
            pose = PoseReading(told_m, 0.0, 0.0, ambiguous=ambiguous and number == 131)
            estimates += odometry.settle(pose)
    assert last(estimates) == close((x_m, 0.0, 0.0), 0.001)


def test_a_short_loss_before_a_hidden_restart_changes_nothing() -> None:
    """One displacement is lost before a longer gap in which the board restarts.

    The next pose shows the board's new origin, so odom does not jump.
    """
    odometry, estimates = driven(75, 0.016)
    estimates += odometry.displace(replace(earth(0.016, 0.0), lost=1), 76 * PERIOD_S)
    for number in range(127, 132):
        still = replace(earth(0.0, 0.0), lost=50 if number == 127 else 0)
        estimates += odometry.displace(still, number * PERIOD_S)
    estimates += odometry.settle(PoseReading(0.0, 0.0, 0.0, ambiguous=True))
    assert last(estimates) == close((0.016 * 77, 0.0, 0.0), 0.001)


@pytest.mark.parametrize(("ambiguous", "x_m"), [(True, 1.2), (False, 0.0)])
def test_a_pose_at_a_new_origin_shows_a_restart_that_the_counters_hide_in_a_short_gap(
    ambiguous: bool, x_m: float
) -> None:
    """The robot drives 1.2 m. After a gap of 0.6 s, the board's pose is at the origin.

    If the counters allow a restart (``ambiguous``), odom stays near 1.2 m. If not, odom moves to
    the origin.
    """
    odometry, estimates = driven(75, 0.016)
    for number in range(90, 140):
        still = replace(earth(0.0, 0.0), lost=15 if number == 90 else 0)
        estimates += odometry.displace(still, number * PERIOD_S)
        if number % 5 == 4:
            pose = PoseReading(0.0, 0.0, 0.0, ambiguous=ambiguous and number == 94)
            estimates += odometry.settle(pose)
    assert last(estimates) == close((x_m, 0.0, 0.0), 0.13)


@pytest.mark.slow
@given(
    st.lists(small_moves, min_size=1, max_size=8),
    st.lists(small_moves, min_size=1, max_size=4),
    headings,
    axis_signs,
)
def test_a_board_that_restarts_goes_on_from_here(
    before: list[Pose], after: list[Pose], initial: float, signs: tuple[int, int, int]
) -> None:
    """The board restarts and counts from zero again, while odom continues without a jump."""
    odometry, trip = Odometry(SETTINGS, signs), Trip(initial, signs)
    attach(odometry, trip.pose)
    for move in before:
        odometry.displace(trip.move(*xyyaw(move)), 0.0)
    trip.board = (0.0, 0.0, 0.0)
    for number, move in enumerate(after):
        reading = replace(
            trip.move(*xyyaw(move)),
            duration_s=None if number == 0 else PERIOD_S,
            restarted=number == 0,
        )
        assert odometry.displace(reading, 0.0) == []
    assert last(odometry.settle(trip.pose)) == close(trip.truth, 1e-8)


@pytest.mark.parametrize("frame", ["earth", "body"])
@pytest.mark.parametrize("lost_m", [0.0, 0.1])
def test_a_disproved_restart_leaves_no_more_uncertainty_than_the_motion_that_was_lost(
    lost_m: float, frame: str
) -> None:
    """A delta seems to show a restart, but the next poses show that the board has not restarted.

    The covariance covers the unnoticed motion ``lost_m`` in x and y. The yaw remains certain.
    """
    odometry, trip = Odometry(replace(SETTINGS, use_board_pose=False)), Trip(0.7)
    attach(odometry, trip.pose)
    odometry.displace(trip.move(0.002, 0.0, 0.0, frame), 0.0)
    trip.move(lost_m, 0.0, 0.0)
    reading = trip.move(0.0, 0.0, 0.0, frame)
    odometry.displace(replace(reading, duration_s=None, restarted=True), 1.0)
    odometry.settle(trip.pose)
    odometry.settle(trip.pose)
    estimates = odometry.displace(trip.move(0.0, 0.0, 0.0, frame), 1.0 + PERIOD_S)
    assert last(estimates) == close((0.002, 0.0, 0.0))
    covariance = estimates[-1].covariance
    assert math.sqrt(covariance.xx) == pytest.approx(lost_m, abs=0.005)
    assert math.sqrt(covariance.yy) == pytest.approx(lost_m, abs=0.005)
    assert math.sqrt(covariance.yaw_yaw) == pytest.approx(0.0, abs=0.005)


def test_a_reset_puts_the_odometry_frame_where_the_robot_stands() -> None:
    """After a reset, pose and covariance are zero, and the x axis points forward."""
    odometry, trip = Odometry(SETTINGS), Trip(0.7)
    attach(odometry, trip.pose)
    for _ in range(10):
        odometry.displace(trip.move(0.02, 0.01, 0.1), 0.0)
    odometry.reset()
    (estimate,) = odometry.displace(trip.move(0.0, 0.0, 0.0), 0.0)
    assert xyyaw(estimate.pose) == close((0.0, 0.0, 0.0))
    assert estimate.covariance == Covariance()
    odometry.settle(trip.pose)
    assert last(odometry.displace(trip.move(0.1, 0.0, 0.0), 0.0)) == close((0.1, 0.0, 0.0))


def test_what_was_driven_before_a_reset_does_not_move_the_pose_after_it() -> None:
    """The odometry is reset before the board has sent its first pose.

    After the first pose, odom contains only the motion since the reset.
    """
    odometry, trip = Odometry(SETTINGS), Trip(0.7)
    for _ in range(3):
        odometry.displace(trip.move(0.02, 0.0, 0.1), 0.0)
    odometry.reset()
    reading = trip.move(0.01, 0.0, 0.0)
    estimates = odometry.displace(reading, 0.0) + attach(odometry, trip.pose)
    assert last(estimates) == close((0.01, 0.0, 0.0))


def test_every_change_of_the_boards_frame_is_counted_and_nothing_else() -> None:
    """The odometry counts how often its frame is moved relative to the board's earth frame.

    Such a move, for example by a reset, makes earlier goals invalid.
    """
    odometry = Odometry(SETTINGS)
    attach(odometry, PoseReading(1.0, 2.0, 0.0))
    counted = [odometry.alignments]
    odometry.displace(earth(0.01, 0.0), 0.0)
    odometry.settle(PoseReading(1.01, 2.0, 0.0))
    counted.append(odometry.alignments)
    for _ in range(2):
        odometry.settle(PoseReading(500.0, 600.0, 1.0))
    counted.append(odometry.alignments)
    odometry.displace(replace(earth(0.0, 0.0), duration_s=None, restarted=True), 0.04)
    odometry.settle(PoseReading(0.0, 0.0, 0.0))
    counted.append(odometry.alignments)
    odometry.reset()
    counted.append(odometry.alignments)
    assert [count - counted[0] for count in counted] == [0, 0, 1, 2, 3]


@pytest.mark.parametrize("frame", ["earth", "body"])
@pytest.mark.parametrize("use_board_pose", [True, False])
@pytest.mark.parametrize("lost", [5, 20, 40])
def test_a_reset_after_a_gap_leaves_no_wrong_heading(
    lost: int, use_board_pose: bool, frame: str
) -> None:
    """A robot ends a turn in a gap, and the odometry is reset after the gap.

    When the next poses have shown the heading in the board's frame, odom has no error.
    """
    odometry, trip = Odometry(replace(SETTINGS, use_board_pose=use_board_pose)), Trip(0.7)
    attach(odometry, trip.pose)
    for _ in range(10):
        odometry.displace(trip.move(0.02, 0.0, 0.04, frame), 0.0)
    for number in range(lost):
        trip.move(0.02, 0.0, 0.04 if number < 2 else 0.0)
    odometry.displace(replace(trip.move(0.02, 0.0, 0.0, frame), lost=lost), 0.0)
    odometry.reset()
    trip.truth = (0.0, 0.0, 0.0)
    estimates = []
    for number in range(50):
        estimates += odometry.displace(trip.move(0.02, 0.0, 0.01, frame), number * PERIOD_S)
        if number % 5 == 4:
            estimates += odometry.settle(trip.pose)
    assert len(estimates) == 50
    assert last(estimates) == close(trip.truth, 1e-6)


@pytest.mark.parametrize("duration_s", [PERIOD_S, None])
def test_a_gap_belongs_to_the_side_of_a_reset_on_which_most_of_it_lies(
    duration_s: float | None,
) -> None:
    """The odometry is reset in a gap of 3 s, near the beginning or near the end of the gap.

    Odom contains the lost motion only after a reset near the beginning.
    """
    for now, way_m in ((3.9, 0.0), (1.1, 0.75)):
        odometry, trip = Odometry(SETTINGS), Trip()
        attach(odometry, trip.pose)
        odometry.displace(trip.move(0.0, 0.0, 0.0), 1.0)
        odometry.reset(now)
        for _ in range(74):
            trip.move(0.01, 0.0, 0.0)
        reading = trip.move(0.01, 0.0, 0.0)
        if duration_s is None:
            reading = replace(reading, dx_m=0.75, duration_s=None)
        else:
            reading = replace(reading, lost=74)
        estimates = odometry.displace(reading, 4.0)
        for _ in range(2):
            estimates += odometry.settle(trip.pose)
        assert [estimate.stamp_s for estimate in estimates] == [4.0]
        if not way_m:
            expected = OdometryEstimate(4.0, Pose(), None, Covariance(), estimates[0].rolled)
            assert estimates == [expected]
        estimates = odometry.displace(trip.move(0.0, 0.0, 0.0), 10.0)
        assert last(estimates) == close((way_m, 0.0, 0.0), 1e-6)
