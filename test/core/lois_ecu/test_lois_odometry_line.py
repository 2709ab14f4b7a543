# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Odometry of a LOIS robot after a reconnect."""

import math

from omnibot_driver.core.lois_ecu import BoardOdometry, SetRpm, Ticks
from omnibot_driver.core.lois_ecu.odometry import LoisOdometry
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings


def test_odometry_before_the_first_ticks_of_a_new_line_leaves_the_covariance_finite() -> None:
    """The driver reconnects, and sends a backward command before the first ticks arrive.

    The last known ticks are then from before the reconnect. The covariance stays finite.
    """
    odometry = LoisOdometry(LoisEcuSettings())
    group = BoardOdometry(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, appended=True)
    for step in range(3):
        odometry.heard_ticks(Ticks(200 * step, 0, 0), 0.2 * step)
        odometry.heard_odometry(group, 0.2 * step + 0.01)
    odometry.connect()
    odometry.wrote(SetRpm(-20, 20), 1.55)
    odometry.heard_odometry(group, 1.56)
    odometry.heard_ticks(Ticks(1650, 0, 0), 1.65)
    odometry.heard_odometry(group, 1.66)
    told = odometry.predict(1.8)
    assert told is not None
    covariance = told.covariance
    assert all(map(math.isfinite, (covariance.xx, covariance.yy, covariance.yaw_yaw)))
    assert math.isfinite(told.pose.x_m)
