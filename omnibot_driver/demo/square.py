# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Steers the robot around the square, from its pose and its current side of the square.

A side is called a leg. Legs 0 to 3 lead along +x, +y, -x and -y of the odometry frame.
"""

import math
from typing import Final

from omnibot_driver.core.commands.limits import shorten
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist

SIDE_M: Final = 1.0
SPEED_MPS: Final = 0.3
CREEP_MPS: Final = 0.05
YAW_RATE_RADPS: Final = 0.5
QUARTER_RAD: Final = math.pi / 2
CORNER_M: Final = 0.01
"""Distance from a corner, in m, below which the robot has reached the corner."""
GAIN_PER_S: Final = 3.0
"""Gain from distance to speed, and from angle error to yaw rate, in 1/s."""
ON_COURSE_RAD: Final = 0.3
"""Error of the heading, in rad, above which the robot turns on the spot before it drives on."""
HALT: Final = BodyTwist(0.0, 0.0, 0.0)


def steer(pose: Pose, leg: int) -> tuple[int, BodyTwist]:
    """Return the current leg, and the velocity to command, for a robot that can drive sideways.

    On each even leg, the robot also turns 90° to the left, and turns back on each odd leg.
    """
    leg, along_m, aside_m = _progress(pose, leg)
    direction_rad = leg % 4 * QUARTER_RAD
    ahead = _speed_mps(along_m)
    ahead, aside = shorten((ahead, -GAIN_PER_S * aside_m), SPEED_MPS)
    turned = max(0.0, along_m / SIDE_M)
    yaw_rad, sign = (QUARTER_RAD * turned, 1) if leg % 2 == 0 else (QUARTER_RAD * (1 - turned), -1)
    yaw_error = math.remainder(yaw_rad - pose.yaw_rad, math.tau)
    yaw_rate = sign * QUARTER_RAD * ahead / SIDE_M + GAIN_PER_S * yaw_error
    velocity = Pose(ahead, aside).turned(direction_rad - pose.yaw_rad)
    yaw_rate = max(-YAW_RATE_RADPS, min(YAW_RATE_RADPS, yaw_rate))
    return leg, BodyTwist(velocity.x_m, velocity.y_m, yaw_rate)


def steer_ahead(pose: Pose, leg: int) -> tuple[int, BodyTwist]:
    """Return the current leg and the velocity to command, for a robot that cannot drive sideways.

    This robot turns at the corners.
    """
    leg, along_m, aside_m = _progress(pose, leg)
    course_rad = leg % 4 * QUARTER_RAD - math.atan2(GAIN_PER_S * aside_m, 2 * SPEED_MPS)
    error_rad = math.remainder(course_rad - pose.yaw_rad, math.tau)
    yaw_rate = max(-YAW_RATE_RADPS, min(YAW_RATE_RADPS, GAIN_PER_S * error_rad))
    ahead = _speed_mps(along_m) if abs(error_rad) <= ON_COURSE_RAD else 0.0
    return leg, BodyTwist(ahead, 0.0, yaw_rate)


def _progress(pose: Pose, leg: int) -> tuple[int, float, float]:
    """Return the current leg, and the robot's distances along the leg and to its left, in m."""
    turned = Pose(pose.x_m - SIDE_M / 2, pose.y_m - SIDE_M / 2).turned(-(leg % 4) * QUARTER_RAD)
    along_m, aside_m = turned.x_m + SIDE_M / 2, turned.y_m + SIDE_M / 2
    return _progress(pose, leg + 1) if SIDE_M - along_m <= CORNER_M else (leg, along_m, aside_m)


def _speed_mps(along_m: float) -> float:
    return min(SPEED_MPS, max(CREEP_MPS, GAIN_PER_S * (SIDE_M - along_m)))
