# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of odometry with damaged, surprising and arbitrary poses of the board."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lossy_drives import (
    PERIOD_S,
    attached,
)

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.odometry.estimate import OdometrySettings
from omnibot_driver.core.odometry.estimator import Odometry
from omnibot_driver.core.readings import DisplacementReading, PoseReading


@pytest.mark.parametrize(
    "bad", [(math.nan, 0.0, 0.0), (1e9, 0.0, 0.0), (0.5, 0.0, 0.0), (0.0, 0.0, 1.0)]
)
def test_one_damaged_pose_moves_nothing(bad: tuple[float, float, float]) -> None:
    """A pose is damaged: it is not finite, out of reach, or contradicted by the next pose.

    The odometry does not move.
    """
    odometry = attached()
    still = DisplacementReading(0.0, 0.0, 0.0, "earth", PERIOD_S, 0)
    for pose in (bad, (0.0, 0.0, 0.0), bad, (0.0, 0.0, 0.0)):
        for _ in range(5):
            (estimate,) = odometry.displace(still, 0.0)
            assert estimate.pose == Pose()
        odometry.settle(PoseReading(*pose))


def test_a_reachable_surprise_is_taken_over_once_confirmed() -> None:
    """A displacement was wrong. Two poses of the board agree with each other, and show the error.

    The driver corrects the odometry in five steps.
    """
    odometry = attached()
    still = DisplacementReading(0.0, 0.0, 0.0, "earth", PERIOD_S, 0)
    odometry.displace(DisplacementReading(0.05, 0.0, 0.0, "earth", PERIOD_S, 0), 0.0)
    odometry.settle(PoseReading(0.0, 0.0, 0.0))
    assert odometry.displace(still, 0.0)[-1].pose.x_m == pytest.approx(0.05)
    odometry.settle(PoseReading(0.0, 0.0, 0.0))
    ways = [odometry.displace(still, 0.0)[-1].pose.x_m for _ in range(5)]
    assert ways == pytest.approx([0.04, 0.03, 0.02, 0.01, 0.0], abs=1e-9)


@pytest.mark.slow
@given(
    st.lists(
        st.one_of(
            st.builds(PoseReading, *[st.floats(allow_nan=True, width=32)] * 3, st.integers(0, 300)),
            st.builds(
                DisplacementReading,
                *[st.floats(-3.3, 3.3)] * 3,
                st.sampled_from(["earth", "body"]),
                st.sampled_from([None, PERIOD_S]),
                st.integers(0, 300),
                st.booleans(),
            ),
        ),
        max_size=40,
    ),
    st.booleans(),
)
def test_any_readings_give_finite_estimates_and_never_a_certain_one(
    readings: list[DisplacementReading | PoseReading], use_board_pose: bool
) -> None:
    """All estimates are finite, whatever displacements and poses come.

    The variances of x, y and yaw are at least 1e-6. So no estimate claims to have no error.
    """
    odometry = Odometry(OdometrySettings(use_board_pose=use_board_pose))
    for number, reading in enumerate(readings):
        if isinstance(reading, PoseReading):
            estimates = odometry.settle(reading)
        else:
            estimates = odometry.displace(reading, number * PERIOD_S)
        for estimate in estimates:
            assert estimate.pose.finite
            c = estimate.covariance
            assert min(c.xx, c.yy, c.yaw_yaw) >= 1e-6
            assert math.isfinite(c.xx + c.yy + c.yaw_yaw)
