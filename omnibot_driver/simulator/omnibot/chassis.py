# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Kinematics of the three omni wheels (manual, Control equation and Odometry equation).

This module knows the kinematics. It knows neither encoder counts, nor time, nor the scales of
commands.
"""

from math import cos, pi, sin
from typing import NamedTuple

_COS30 = cos(pi / 6)
_SIN30 = 0.5

Wheels = tuple[float, float, float]
"""One value for each of the wheels A, B, C."""


class PlanarPose(NamedTuple):
    """A pose in m and rad. The yaw is unwrapped."""

    x_m: float
    y_m: float
    yaw_rad: float

    def moved(self, dx_body_m: float, dy_body_m: float, dyaw_rad: float) -> "PlanarPose":
        """Return the pose after a displacement in the body frame, in m and rad.

        The displacement is rotated by the heading in the middle of the step (manual, Odometry
        equation).
        """
        heading_rad = self.yaw_rad + dyaw_rad / 2
        c, s = cos(heading_rad), sin(heading_rad)
        return PlanarPose(
            self.x_m + c * dx_body_m - s * dy_body_m,
            self.y_m + s * dx_body_m + c * dy_body_m,
            self.yaw_rad + dyaw_rad,
        )


def rims_from_body(vx: float, vy: float, yaw_rate: float, base_radius_m: float) -> Wheels:
    """Return the rim speeds (or distances) of wheels A, B, C for a body twist (or displacement).

    Units: m/s and rad/s, or m and rad.
    """
    turning = base_radius_m * yaw_rate
    return (
        -_COS30 * vx - _SIN30 * vy - turning,
        _COS30 * vx - _SIN30 * vy - turning,
        vy - turning,
    )


def body_from_rims(rims: Wheels, base_radius_m: float) -> tuple[float, float, float]:
    """Return the body twist (or displacement) for rim speeds (or distances) of wheels A, B, C.

    Units: m/s and rad/s, or m and rad. Source: the manual's odometry matrix.
    """
    a, b, c = rims
    return (
        (b - a) / (2 * _COS30),
        (2 * c - a - b) / 3,
        -(a + b + c) / (3 * base_radius_m),
    )
