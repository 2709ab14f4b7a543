# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Odometry while reports of a LOIS ECU are lost on a bad line."""

import math

import pytest
from lois_drives import HOST_GAINS, Rig, nominal

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("gap_s", [0.7, 0.9])
def test_lost_reports_hardly_raise_the_uncertainty_of_a_steady_drive(gap_s: float) -> None:
    """The robot drives a curve backward, and no report arrives for a while.

    The set-points do not change, so the motion is known. The heading is right, and its standard
    deviation grows by a few degrees only.
    """
    rig = Rig(nominal("firmware"), HOST_GAINS)
    rig.run(4.0)
    rig.order(-20, -24, 6.0)
    before_deg = math.degrees(math.sqrt(rig.outcome().last.covariance.yaw_yaw))
    rig._loss = 1.0
    rig.order(-20, -24, gap_s)
    rig._loss = 0.0
    rig.order(-20, -24, 1.0)
    one = rig.outcome()
    assert math.degrees(math.sqrt(one.last.covariance.yaw_yaw)) < before_deg + 10.0
    assert abs(one.error.yaw_rad) < math.radians(10.0)
    assert one.sigmas < 3.0


def test_a_set_point_that_changed_in_a_silence_may_not_have_arrived() -> None:
    """The line is interrupted in both directions, and the robot is told to stop meanwhile.

    The robot drives on. The covariance includes the distance.
    """
    rig = Rig(nominal("firmware"), HOST_GAINS)
    rig.run(4.0)
    rig.order(-20, -20, 4.0)
    rig._loss = 1.0
    rig.order(0, 0, 1.0)
    rig._loss = 0.0
    rig.order(0, 0, 2.5)
    assert rig.outcome().sigmas < 3.0
