# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Control laws that drive the robot, by its odometry, from pose to pose.

This module knows poses and speeds; it does not know how commands are sent.
"""

import math
from collections.abc import Sequence
from typing import Final

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.readings import Vector3
from omnibot_driver.tools.calibrate.motion import Law

NEAR_M: Final = 0.005
NEAR_RAD: Final = 0.01
BRAKING: Final = 0.15
"""Deceleration before a waypoint, in m/s².

It is half of the largest acceleration that the tool commands.
"""
ANGULAR_BRAKING: Final = 0.4


def visit(places: Sequence[Pose], speed: float, turning: float) -> Law:
    """Return a control law that drives the robot from pose to pose, and stops it at each pose.

    ``places``: the poses relative to the start, with unwrapped yaw.

    ``speed``, ``turning``: largest speed and yaw rate, in m/s and rad/s.
    """
    number = 0

    def law(_seconds: float, pose: Pose) -> Vector3 | None:
        nonlocal number
        while number < len(places) and _arrived(pose, places[number]):
            number += 1
        return _towards(pose, places[number], speed, turning) if number < len(places) else None

    return law


def straight(way_m: float, speed: float) -> Law:
    """Return a control law that drives a base with two wheels straight ahead.

    ``way_m``: distance in m. ``speed``: largest speed in m/s.
    """

    def law(_seconds: float, pose: Pose) -> Vector3 | None:
        left_m = way_m - pose.x_m
        if left_m < NEAR_M:
            return None
        return min(speed, math.sqrt(2 * BRAKING * left_m)), 0.0, 0.0

    return law


def turn(angle_rad: float, turning: float) -> Law:
    """Return a control law that turns the robot on the spot, at up to ``turning`` rad/s.

    The turn is to the left if ``angle_rad`` is positive.
    """
    sign = math.copysign(1.0, angle_rad)

    def law(_seconds: float, pose: Pose) -> Vector3 | None:
        left_rad = sign * (angle_rad - pose.yaw_rad)
        if left_rad < NEAR_RAD:
            return None
        return 0.0, 0.0, sign * min(turning, math.sqrt(2 * ANGULAR_BRAKING * left_rad))

    return law


def square(side_m: float, sign: int) -> list[Pose]:
    """Return the eight poses on a square drive: after each side, and after each quarter turn.

    ``sign``: 1 for turns to the left, -1 for turns to the right.
    """
    places = []
    place = Pose()
    for _ in range(4):
        place = place.moved(Pose(side_m, 0.0, 0.0))
        places.append(place)
        place = place + Pose(0.0, 0.0, sign * math.pi / 2)
        places.append(place)
    return places


def _arrived(pose: Pose, place: Pose) -> bool:
    off = place - pose
    return off.way_m < NEAR_M and abs(off.yaw_rad) < NEAR_RAD


def _towards(pose: Pose, place: Pose, speed: float, turning: float) -> Vector3:
    off = place - pose
    way = off.turned(-pose.yaw_rad)
    x = y = yaw_rate = 0.0
    if way.way_m > NEAR_M / 2:
        per_m = min(speed, math.sqrt(2 * BRAKING * way.way_m)) / way.way_m
        x, y = per_m * way.x_m, per_m * way.y_m
    if abs(off.yaw_rad) > NEAR_RAD / 2:
        fastest = min(turning, math.sqrt(2 * ANGULAR_BRAKING * abs(off.yaw_rad)))
        yaw_rate = math.copysign(fastest, off.yaw_rad)
    return x, y, yaw_rate
