# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of gap interpolation: the displacements before and after a gap show the motion in it."""

import math
from dataclasses import replace

import pytest
from synthetic_board import PERIOD_S, SETTINGS, Trip, attach, body, close, last, xyyaw

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.odometry.estimator import Odometry
from omnibot_driver.core.odometry.gap_interpolation import GapInterpolation
from omnibot_driver.core.readings import DisplacementReading, PoseReading


def after(lost: int, dx_m: float, duration_s: float | None = PERIOD_S) -> DisplacementReading:
    """Return a displacement straight ahead. ``lost``: number of displacements missing before it."""
    return DisplacementReading(dx_m, 0.0, 0.0, "body", duration_s, lost)


def test_a_gap_held_the_mean_of_both_sides_as_often_as_displacements_are_missing() -> None:
    """Four displacements are missing. The speed is 0.5 m/s before this gap, and 1 m/s after it.

    For each missing displacement, the estimate is the mean, 0.75 m/s.
    """
    bridge = GapInterpolation()
    assert bridge.tangents(body(0.02, 0.0), None) == (Pose(), Pose(0.02))
    lost, own = bridge.tangents(after(4, 0.04), None)
    assert xyyaw(lost) == pytest.approx((4 * 0.03, 0.0, 0.0))
    assert own == Pose(0.04)


def test_a_bridge_stands_for_two_seconds_of_motion_at_the_most() -> None:
    """After ten seconds without displacements, only two seconds of motion are estimated.

    The driver stops the robot of a silent board.
    """
    bridge = GapInterpolation()
    bridge.tangents(body(0.02, 0.0), None)
    lost, _ = bridge.tangents(after(250, 0.02), None)
    assert xyyaw(lost) == pytest.approx((50 * 0.02, 0.0, 0.0))


@pytest.mark.parametrize("missing", [0, 1, 7])
def test_in_an_even_curve_a_gap_held_the_way_itself(missing: int) -> None:
    """The robot drives a curve with a constant twist. Displacements in earth axes are missing.

    The motion that is estimated for the missing displacements is exact.
    """
    bridge, trip = GapInterpolation(), Trip(0.7)
    bridge.tangents(trip.move(0.02, 0.01, 0.1), 0.7)
    before = trip.board
    for _ in range(missing):
        trip.move(0.02, 0.01, 0.1)
    told = trip.move(0.02, 0.01, 0.1)
    reading = DisplacementReading(
        told.dx_m, told.dy_m, told.dyaw_rad, "earth", PERIOD_S, lost=missing
    )
    lost, own = bridge.tangents(reading, before[2])
    assert xyyaw(own) == pytest.approx((0.02, 0.01, 0.1))
    assert xyyaw(lost) == pytest.approx((0.02 * missing, 0.01 * missing, 0.1 * missing))


def test_what_took_an_unknown_time_is_not_a_side_of_a_gap() -> None:
    """A displacement has an unknown duration, for example after a pause. So its speed is unknown.

    Therefore, this displacement is not used to estimate the motion in a gap.
    """
    bridge = GapInterpolation()
    bridge.tangents(body(0.02, 0.0), None)
    assert bridge.tangents(after(0, 0.5, None), None) == (Pose(), Pose(0.5))
    assert bridge.last is None
    lost, _ = bridge.tangents(after(3, 0.01), None)
    assert xyyaw(lost) == pytest.approx((0.03, 0.0, 0.0))


def test_if_only_poses_arrive_they_show_the_present_motion() -> None:
    """The last displacement shows 0.5 m/s. Then ten displacements are lost, and only poses arrive.

    The poses show 1 m/s. Gap interpolation uses the speed of the poses.
    """
    bridge = GapInterpolation()
    bridge.tangents(body(0.02, 0.0), None)
    bridge.prove()
    for deviation_m in (5 * 0.02, 0.0):
        bridge.missing += 5
        bridge.prove(Pose(deviation_m))
        assert bridge.last is not None
        assert xyyaw(bridge.last[0]) == pytest.approx((0.04, 0.0, 0.0))


def test_a_pose_after_a_displacement_does_not_change_the_last_motion() -> None:
    """A displacement arrives between two poses. The second pose does not change the stored motion.

    The displacement shows the present motion better than the difference of the two poses.
    """
    bridge = GapInterpolation()
    bridge.tangents(body(0.02, 0.0), None)
    bridge.missing += 1
    bridge.prove(Pose(0.01))
    assert bridge.last == (Pose(0.02), PERIOD_S)


@pytest.mark.parametrize("frame", ["earth", "body"])
@pytest.mark.parametrize("poses", range(3, 9))
def test_a_robot_that_came_to_rest_while_only_poses_arrived_is_where_they_put_it(
    frame: str, poses: int
) -> None:
    """The robot turns at 2 rad/s. Then only poses arrive, and they show that the robot is at rest.

    The odometry estimates no motion for displacements that are lost later.
    """
    odometry, trip = Odometry(SETTINGS), Trip()
    attach(odometry, trip.pose)
    for _ in range(10):
        odometry.displace(trip.move(0.0, 0.0, 0.08, frame), 0.0)
    odometry.settle(trip.pose)
    for _ in range(poses):
        odometry.settle(replace(trip.pose, lost=5))
    still = replace(trip.move(0.0, 0.0, 0.0, frame), lost=1)
    for _ in range(5):
        estimates = odometry.displace(still, 0.0)
    assert odometry.refused_poses == 0
    assert last(estimates) == close(trip.truth, 1e-6)


def test_the_uncertainty_of_a_gap_does_not_depend_on_the_poses_in_it_if_they_are_not_used() -> None:
    """Poses within a gap do not change its uncertainty if ``use_board_pose`` is False.

    Fifty displacements are lost. The uncertainty is the same with and without poses among them.
    """
    deviations = []
    for poses in (0, 9):
        odometry, trip = Odometry(replace(SETTINGS, use_board_pose=False)), Trip()
        attach(odometry, trip.pose)
        odometry.displace(trip.move(0.0, 0.0, 0.02), 0.0)
        for _ in range(poses):
            odometry.settle(replace(trip.pose, lost=5))
        reading = replace(trip.move(0.0, 0.0, 0.02), lost=50 - 5 * poses)
        estimates = odometry.displace(reading, 51 * PERIOD_S)
        deviations.append(math.sqrt(estimates[-1].covariance.yaw_yaw))
    assert deviations[1] == pytest.approx(deviations[0])


@pytest.mark.parametrize("frame", ["earth", "body"])
@pytest.mark.parametrize("turn", [0.0, 0.04, -0.08])
def test_a_board_that_restarts_in_full_motion_leaves_room_for_the_way_to_rest(
    frame: str, turn: float
) -> None:
    """The covariance includes the distance and turn of a robot that rolls to rest after a restart.

    The robot drives at 0.5 m/s, and slows down evenly within 0.5 s.
    """
    odometry, trip = Odometry(SETTINGS), Trip()
    attach(odometry, trip.pose)
    for _ in range(10):
        odometry.displace(trip.move(0.02, 0.0, turn, frame), 1.0)
    estimates = odometry.displace(
        DisplacementReading(0.0, 0.0, 0.0, frame, None, 0, restarted=True), 4.0
    )
    estimates += odometry.settle(PoseReading(0.0, 0.0, 0.0))
    covariance = estimates[-1].covariance
    assert math.sqrt(covariance.xx) > 0.5 * 0.5 / 2
    assert math.sqrt(covariance.yaw_yaw) > abs(turn) / PERIOD_S * 0.5 / 2


def test_a_board_that_restarts_late_in_a_silence_leaves_room_for_the_way_driven_before_it() -> None:
    """After 3 s without data, a board reports that it restarted 0.2 s ago.

    The standard deviations of x and yaw exceed half of the motion that was possible before the
    restart.
    """
    odometry, trip = Odometry(SETTINGS), Trip()
    attach(odometry, trip.pose)
    for _ in range(10):
        odometry.displace(trip.move(0.02, 0.0, -0.04), 1.0)
    nothing = DisplacementReading(0.0, 0.0, 0.0, "body", None, 0, restarted=True, up_s=0.2)
    estimates = odometry.displace(nothing, 4.0) + odometry.settle(PoseReading(0.0, 0.0, 0.0))
    covariance = estimates[-1].covariance
    assert math.sqrt(covariance.xx) > 0.5 * 2.8 / 2
    assert math.sqrt(covariance.yaw_yaw) > 0.04 / PERIOD_S * 2.8 / 2


def test_a_drive_in_an_unknown_direction_ends_anywhere_within_its_length() -> None:
    """A board restarts after 40 s without data, in which the robot may have turned.

    The direction of the next drive of 2 m is unknown, so x and y become uncertain by over 1 m.
    """
    odometry = Odometry(SETTINGS)
    attach(odometry, PoseReading(0.0, 0.0, 0.0))
    odometry.displace(body(0.0, 0.0, PERIOD_S), 1.0)
    nothing = DisplacementReading(0.0, 0.0, 0.0, "body", None, 0, restarted=True, up_s=0.0)
    before = (odometry.displace(nothing, 41.0), odometry.settle(PoseReading(0.0, 0.0, 0.0)))[0][-1]
    for _ in range(100):
        after = odometry.displace(body(0.02, 0.0), 41.0)[-1]
    assert 1.0 < math.sqrt(after.covariance.xx - before.covariance.xx) < 5.0
    assert 1.0 < math.sqrt(after.covariance.yy - before.covariance.yy) < 5.0


def test_a_way_back_in_another_unknown_direction_does_not_lead_back() -> None:
    """By odom, the robot drives 2 m forward, then 2 m back. It may have turned before each drive.

    A restart of the board hides such a turn. The errors of the two drives do not cancel, so x is
    uncertain by more than 1 m.
    """
    odometry = Odometry(SETTINGS)
    attach(odometry, PoseReading(0.0, 0.0, 0.0))
    nothing = DisplacementReading(0.0, 0.0, 0.0, "body", None, 0, restarted=True, up_s=0.0)
    for now, step in ((41.0, 0.02), (82.0, -0.02)):
        odometry.displace(body(0.0, 0.0, PERIOD_S), now - 40.0)
        odometry.displace(nothing, now)
        odometry.settle(PoseReading(0.0, 0.0, 0.0))
        for _ in range(100):
            after = odometry.displace(body(step, 0.0), now)[-1]
    assert after.pose.x_m == pytest.approx(0.0, abs=0.02)
    assert 1.0 < math.sqrt(after.covariance.xx) < 5.0


def test_a_loss_that_a_pose_showed_before_a_reset_is_not_motion_after_it() -> None:
    """A pose shows that five displacements were lost. Then the odometry is reset.

    The lost motion took place before the reset, so odom contains only the motion after the reset.
    """
    odometry, trip = Odometry(SETTINGS), Trip()
    for _ in range(4):
        odometry.displace(trip.move(0.02, 0.0, 0.0), 0.0)
    for _ in range(5):
        trip.move(0.02, 0.0, 0.0)
    odometry.settle(replace(trip.pose, lost=5))
    odometry.reset(0.0)
    for _ in range(5):
        odometry.displace(trip.move(0.02, 0.0, 0.0), 0.0)
    assert last(odometry.settle(trip.pose)) == close((5 * 0.02, 0.0, 0.0))


def test_a_loss_that_a_pose_showed_is_bridged_if_the_board_did_not_restart() -> None:
    """A displacement seems to show a restart.

    Two later displacements are lost, and then two poses disprove the restart. The odometry
    (``use_board_pose=False``) interpolates the lost motion.
    """
    odometry, trip = Odometry(replace(SETTINGS, use_board_pose=False)), Trip()
    attach(odometry, trip.pose)
    for _ in range(10):
        odometry.displace(trip.move(0.02, 0.0, 0.0), 0.0)
    reading = replace(trip.move(0.02, 0.0, 0.0), duration_s=None, restarted=True)
    odometry.displace(reading, 0.0)
    odometry.displace(trip.move(0.02, 0.0, 0.0), 0.0)
    for _ in range(2):
        trip.move(0.02, 0.0, 0.0)
    assert odometry.settle(replace(trip.pose, lost=2)) == []
    odometry.settle(trip.pose)
    estimates = []
    for _ in range(10):
        estimates += odometry.displace(trip.move(0.02, 0.0, 0.0), 0.0)
    assert last(estimates) == close(trip.truth)


@pytest.mark.parametrize("frame", ["earth", "body"])
def test_a_pose_that_disproves_a_restart_also_removes_the_uncertainty_of_it(frame: str) -> None:
    """A displacement makes the odometry suspect a restart, and the next pose disproves the restart.

    The covariance is then the same as without the suspicion.
    """
    deviations = []
    for suspected in (False, True):
        odometry, trip = Odometry(SETTINGS), Trip()
        attach(odometry, trip.pose)
        for _ in range(10):
            odometry.displace(trip.move(0.02, 0.0, 0.04, frame), 1.0)
        odometry.settle(trip.pose)
        reading = trip.move(0.02, 0.0, 0.04, frame)
        if suspected:
            reading = replace(reading, duration_s=None, restarted=True)
        odometry.displace(reading, 1.0)
        odometry.settle(trip.pose)
        covariance = odometry.displace(trip.move(0.02, 0.0, 0.04, frame), 1.0)[-1].covariance
        deviations.append((math.sqrt(covariance.xx), math.sqrt(covariance.yaw_yaw)))
    assert deviations[1] == pytest.approx(deviations[0], rel=0.01)


@pytest.mark.parametrize("frame", ["earth", "body"])
@pytest.mark.parametrize("missing", [4, 9])
def test_a_loss_that_a_pose_shows_before_the_frame_is_known_is_bridged(
    frame: str, missing: int
) -> None:
    """A displacement is lost at the start, before two poses have shown the board's heading.

    The odometry estimates the lost motion when the first or second pose shows the loss.
    """
    odometry, trip = Odometry(SETTINGS), Trip(0.3)
    estimates = []
    for count in range(30):
        reading = trip.move(0.02, 0.0, 0.02, frame)
        if count != missing:
            estimates += odometry.displace(reading, count * PERIOD_S)
        if count % 5 == 4:
            estimates += odometry.settle(replace(trip.pose, lost=int(count == missing)))
    assert last(estimates) == close(trip.truth, 1e-3)
