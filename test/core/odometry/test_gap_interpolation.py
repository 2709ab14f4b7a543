# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of gap interpolation: the displacements before and after a gap show the motion in it."""

import pytest
from synthetic_board import PERIOD_S, Trip, body, xyyaw

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.odometry.gap_interpolation import GapInterpolation
from omnibot_driver.core.readings import DisplacementReading


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
    """Displacements of ten seconds are missing. Only two seconds of motion are estimated for them.

    For the remaining time no motion is added, because the driver stops the robot of a silent board.
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
