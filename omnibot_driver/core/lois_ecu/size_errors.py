# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Covariance of a pose from errors of the wheels' sizes, and from a slip common to both wheels.

The path is computed again with each error, positive and negative. The covariance is the spread of
the poses in which these paths end. Input: distances of the wheels; output: covariance of x, y and
yaw.
"""

import math
from typing import Final

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.odometry.covariance import Covariance

KINDS: Final = 3
"""Number of kinds of errors: size of the left wheel, size of the right wheel, slip of both
wheels."""
WHEEL_SCALE: Final = 0.01
WHEEL_SLIP: Final = 0.005
"""``WHEEL_SCALE``: standard deviation of the relative error of a wheel's size. ``WHEEL_SLIP``:
standard deviation of the fraction of the distance that is lost because both wheels slip."""


class SizeErrors:
    """Variants of the robot's path. Each variant has one error: a wrong wheel size, or a slip."""

    def __init__(self) -> None:
        spread = math.sqrt(KINDS)
        # Each error is constant along the path, so the pose error soon is not proportional to its
        # cause.
        self._factors = [
            (1 + sign * spread * left, 1 + sign * spread * right)
            for left, right in (
                (WHEEL_SCALE, 0.0),
                (0.0, WHEEL_SCALE),
                (WHEEL_SLIP, WHEEL_SLIP),
            )
            for sign in (-1.0, 1.0)
        ]
        self._places = [(0.0, 0.0, 0.0)] * len(self._factors)
        self._believed = 0.0, 0.0, 0.0

    def move(self, left_m: float, right_m: float, track_m: float) -> None:
        """Extend the path, and its variants with errors, by the distances that the wheels rolled.

        ``track_m``: track width; negative if the wheels are swapped.
        """
        self._believed = _moved(self._believed, left_m, right_m, track_m)
        self._places = [
            _moved(place, left * left_m, right * right_m, track_m)
            for place, (left, right) in zip(self._places, self._factors, strict=True)
        ]

    def covariance(self, yaw_rad: float) -> Covariance:
        """Return the covariance of the pose, in a frame in which the robot's yaw is ``yaw_rad``."""
        x_m, y_m, yaw = self._believed
        turn = yaw_rad - yaw
        cos, sin = math.cos(turn), math.sin(turn)
        weight = 1 / len(self._places)
        errors = []
        for place_x_m, place_y_m, place_yaw in self._places:
            dx_m, dy_m = place_x_m - x_m, place_y_m - y_m
            error = Pose(cos * dx_m - sin * dy_m, sin * dx_m + cos * dy_m, place_yaw - yaw)
            errors.append((weight, error.x_m, error.y_m, error.yaw_rad))
        return Covariance.diagonal(0.0, 0.0).with_errors(errors)


def _moved(
    place: tuple[float, float, float], left_m: float, right_m: float, track_m: float
) -> tuple[float, float, float]:
    x_m, y_m, yaw = place
    turn, way = (right_m - left_m) / track_m, (left_m + right_m) / 2
    middle = yaw + turn / 2
    return x_m + way * math.cos(middle), y_m + way * math.sin(middle), yaw + turn
