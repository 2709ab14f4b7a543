# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Poses in the plane, and the displacements between them."""

import math

from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.values import value

Signs = tuple[int, int, int]


@value(frozen=True, slots=True)
class Pose:
    """A pose, displacement or tangent (twist x time): x and y in m, unwrapped yaw in rad."""

    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0

    def __add__(self, other: "Pose") -> "Pose":
        """Add component by component. This is valid for displacements in one frame."""
        return Pose(self.x_m + other.x_m, self.y_m + other.y_m, self.yaw_rad + other.yaw_rad)

    def __sub__(self, other: "Pose") -> "Pose":
        """Subtract component by component."""
        return Pose(self.x_m - other.x_m, self.y_m - other.y_m, self.yaw_rad - other.yaw_rad)

    def times(self, x: float, y: float, yaw: float) -> "Pose":
        """Multiply component by component."""
        return Pose(x * self.x_m, y * self.y_m, yaw * self.yaw_rad)

    @property
    def way_m(self) -> float:
        """Length of the position vector, in m."""
        return math.hypot(self.x_m, self.y_m)

    @property
    def finite(self) -> bool:
        """Whether all components are finite."""
        return all(map(math.isfinite, (self.x_m, self.y_m, self.yaw_rad)))

    def turned(self, angle_rad: float) -> "Pose":
        """Return this displacement, rotated by ``angle_rad``. The yaw component stays the same."""
        cos, sin = math.cos(angle_rad), math.sin(angle_rad)
        return Pose(cos * self.x_m - sin * self.y_m, sin * self.x_m + cos * self.y_m, self.yaw_rad)

    def moved(self, displacement: "Pose") -> "Pose":
        """Return the pose after a displacement that is given in this pose's own axes."""
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        dx_m, dy_m = displacement.x_m, displacement.y_m
        return Pose(
            self.x_m + cos * dx_m - sin * dy_m,
            self.y_m + sin * dx_m + cos * dy_m,
            self.yaw_rad + displacement.yaw_rad,
        )

    def way_to(self, other: "Pose") -> "Pose":
        """Return the displacement to ``other`` in this pose's own axes, with a yaw of -pi to pi."""
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        dx_m, dy_m = other.x_m - self.x_m, other.y_m - self.y_m
        return Pose(
            cos * dx_m + sin * dy_m,
            cos * dy_m - sin * dx_m,
            math.remainder(other.yaw_rad - self.yaw_rad, math.tau),
        )

    def over(self, duration_s: float) -> BodyTwist:
        """Return the constant twist that produces this tangent (twist x time) in ``duration_s``."""
        return BodyTwist(self.x_m / duration_s, self.y_m / duration_s, self.yaw_rad / duration_s)


def log_of(chord: Pose) -> Pose:
    """Return the tangent (twist x time) that makes this displacement: the SE(2) logarithm."""
    half = chord.yaw_rad / 2
    if not half:
        return chord
    cos, sin = math.cos(half), math.sin(half)
    stretch = half / sin
    x_m, y_m = chord.x_m, chord.y_m
    return Pose(stretch * (cos * x_m + sin * y_m), stretch * (cos * y_m - sin * x_m), chord.yaw_rad)


def roll(tangent: Pose) -> Pose:
    """Return the displacement that this tangent (twist x time) makes: the SE(2) exponential."""
    half = tangent.yaw_rad / 2
    if not half:
        return tangent
    cos, sin = math.cos(half), math.sin(half)
    shrink = sin / half
    x_m, y_m = tangent.x_m, tangent.y_m
    return Pose(shrink * (cos * x_m - sin * y_m), shrink * (sin * x_m + cos * y_m), tangent.yaw_rad)
