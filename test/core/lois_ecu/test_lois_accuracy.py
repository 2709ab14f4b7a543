# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The error of a LOIS robot's odometry after a drive, on both kinds of firmware.

``test/integrity/lois_odometry.py`` runs many drives.
"""

import math

import pytest
from lois_drives import CLASSES, drive, driven, motion, nominal, off_m, wrong

from omnibot_driver.simulator.lois_ecu import Firmware

pytestmark = pytest.mark.slow

BOTH = pytest.mark.parametrize("firmware", ["documented", "firmware"])


@BOTH
def test_forward_it_is_within_2_percent_and_3_degrees_on_5_m(firmware: Firmware) -> None:
    """The robot drives a curve of 5 m forward with wheels of the right size.

    The position is right within 2 % of the distance, and the heading within 3°.
    """
    one = driven(firmware, "curve")
    assert one.way_m > 5.0
    assert off_m(one) < max(0.02, 0.02 * one.way_m)
    assert abs(one.error.yaw_rad) < math.radians(3.0)


@BOTH
def test_in_place_it_is_within_3_percent_of_the_angle(firmware: Firmware) -> None:
    """After a turn in place, the estimated angle is right within 3 %.

    This holds although the public firmware counts no ticks of the wheel that rolls back.
    """
    one = driven(firmware, "in place")
    assert one.turned_rad > 8.0
    assert abs(one.error.yaw_rad) < 0.03 * one.turned_rad


@pytest.mark.parametrize(
    ("firmware", "name"),
    [
        ("documented", "jerky"),
        ("firmware", "curve"),
        ("firmware", "jerky"),
    ],
)
def test_the_covariance_is_honest(firmware: Firmware, name: str) -> None:
    """The wheels have wrong sizes and slip on uneven ground. The covariance fits the pose's error.

    At the limit of this test, only one in 10,000 drives fails by chance.
    """
    assert motion(wrong(firmware, 1000), name).nees < 21.1


def test_after_a_square_with_turns_on_the_spot_it_is_within_3_sigma() -> None:
    """The robot drives a square with turns on the spot.

    The public firmware counts no ticks of a wheel that turns backward. The pose is still right
    within 3 sigma.
    """
    one = motion(nominal("firmware", 1000), "right", side_m=0.5)
    assert off_m(one) < 0.15
    assert one.sigmas < 3.0


def test_hard_steering_to_both_sides_is_followed() -> None:
    """The wheels often change their direction, on a board that counts ticks in both directions.

    The odometry ends within 5 cm and 5° of the true pose.
    """
    one = motion(nominal("documented", 1001), "jerky")
    assert off_m(one) < 0.05
    assert abs(one.error.yaw_rad) < math.radians(5.0)


@pytest.mark.parametrize(
    ("firmware", "name"),
    [("documented", "curve"), ("firmware", "in place")],
)
def test_with_a_hundredth_of_all_bytes_lost_it_is_hardly_worse(
    firmware: Firmware, name: str
) -> None:
    """The odometry stays accurate if one byte in a hundred is lost.

    About half of the reports are damaged, but later tick counts include their ticks.
    """
    one = drive(nominal(firmware, 5), CLASSES[name], loss=0.01)
    assert off_m(one) < 0.1 * max(one.way_m, 2.0)
    assert abs(one.error.yaw_rad) < math.radians(10.0)
    assert one.sigmas < 4.0
