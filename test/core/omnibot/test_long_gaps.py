# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of odometry after gaps of more than a second, with and without a pose of the board."""

import pytest
from lossy_drives import (
    PERIOD_S,
    ROUNDING_M,
    attached,
    line,
    lose,
    settled,
)
from lossy_odometry import DELTA, POSE, board_pose, loses_nothing

from omnibot_driver.core.odometry.estimate import OdometryEstimate, OdometrySettings
from omnibot_driver.core.readings import DisplacementReading, PoseReading


@pytest.mark.slow
@pytest.mark.parametrize("lost", [26, 50, 100, 250])
def test_after_a_long_gap_the_first_pose_out_of_it_is_the_right_one(lost: int) -> None:
    """The first pose that is published after a gap of more than 1 s is right.

    The driver holds this pose for up to 0.2 s, until the board's next pose arrives.
    """
    for seed in range(5):
        on = line(seed)
        lose(on, lost * PERIOD_S)
        attached, known = on.attached, {}
        found: list[OdometryEstimate] = []
        while not found:
            found = on.run(0.01)
            known[on.now] = on.told
        assert on.now - found[0].stamp_s < 0.21
        for estimate in found:
            off = attached.way_to(known[min(known, key=lambda at: abs(at - estimate.stamp_s))])
            assert off.way_to(estimate.pose).way_m < ROUNDING_M


def test_after_a_long_gap_nothing_waits_for_a_pose_that_does_not_come() -> None:
    """After a long gap, the driver waits only about 0.25 s for the next pose.

    If this pose is lost too, the motion in the gap is interpolated.
    """
    on = line(1)
    lose(on, 2.0)
    on.loses = lambda data, _now: data[:2] == POSE
    assert on.run(0.2) == []
    assert len(on.run(0.08)) >= 6
    on.loses = loses_nothing
    on.run(1.0)
    assert settled(on)


@pytest.mark.slow
@pytest.mark.parametrize("gap_s", [1.2, 5.0, 24.0])
@pytest.mark.parametrize("frame", ["earth", "body"])
def test_a_long_gap_that_ends_with_a_pose_is_not_bridged(gap_s: float, frame: str) -> None:
    """If a pose ends a long gap, odom does not continue the motion from before the gap.

    The robot stops early in the gap. The first odom after the gap is right.
    """
    for seed in range(3 if gap_s < 24.0 else 1):
        on = line(seed, frame=frame)
        while on.board.tick % 20 != 16:
            on.run(0.01)
        on.drives = False
        before = on.estimates[-1].pose
        on.loses = lambda _data, _now: True
        on.run(gap_s + 0.03)
        on.loses = lambda data, _now: data[:2] == DELTA
        on.run(0.01)
        on.loses = loses_nothing
        moved_m = before.way_to(on.attached.way_to(board_pose(on.board))).way_m
        after = on.run(PERIOD_S)
        assert len(after) == 1
        assert settled(on), on.error
        after += on.run(0.2)
        assert max(before.way_to(estimate.pose).way_m for estimate in after) < moved_m + 0.01


@pytest.mark.slow
@pytest.mark.parametrize("gap_s", [3, 8])
def test_motion_in_a_long_gap_is_not_lost_if_poses_come_without_deltas(gap_s: int) -> None:
    """Motion in a long gap is not lost if poses arrive before the next delta.

    The first pose after the gap shows the motion.
    """
    for seed in range(3):
        on = line(seed)
        lose(on, gap_s)
        on.drives = False
        lose(on, 1.0)
        lose(on, 0.65, DELTA)
        on.run(1.0)
        assert settled(on), on.error


def test_a_pose_that_does_not_correct_continues_the_motion_for_two_seconds_at_most() -> None:
    """In a long gap, odom continues the motion for only 2 s if poses do not correct odom.

    ``use_board_pose`` is off. At 0.25 m/s, odom continues by 0.5 m.
    """
    odometry = attached(OdometrySettings(use_board_pose=False))
    step = DisplacementReading(0.01, 0.0, 0.0, "earth", PERIOD_S, 0)
    (before,) = odometry.displace(step, 0.0)
    odometry.settle(PoseReading(0.05, 0.0, 0.0, lost=600))
    (after,) = odometry.displace(step, 601 * PERIOD_S)
    assert after.pose.x_m - before.pose.x_m == pytest.approx(0.51)
