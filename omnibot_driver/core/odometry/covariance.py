# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The uncertainty of the odometry. Its three sources of error are stored separately.

The sources are the wheels, gaps in the board's reports, and corrections that are still due.
docs/internals/architecture.md explains when the error of each source shrinks.

This module knows covariances and the wheels' geometry; it does not know frames or boards.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from typing import Final

from omnibot_driver.core.geometry.kinematics import Kinematics
from omnibot_driver.core.geometry.omni import OmniKinematics
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.values import value

INITIAL_VARIANCE: Final = 1e-6
"""Initial variances of (1 mm)² and (1 mrad)²: about the resolution of the board's own poses."""
UNKNOWN_YAW_VARIANCE: Final = math.pi**2 / 3
"""Variance of a direction of which nothing is known, in rad²."""
ASTRAY: Final = 0.7
"""Extra position error, in m per driven metre and per rad² of heading variance (see ``Astray``)."""
ASTRAY_RAD2: Final = 0.03
"""Variance of the heading, in rad², above which the odometry adds the errors of ``Astray``.

Below this limit, these errors are smaller than those of wheel slip.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryNoise:
    """How fast the uncertainty grows. Each wheel has its own errors.

    * ``wheel_drift``: standard deviation of a wheel's random error after 1 m of rim motion, in m.
    * ``wheel_scale``: standard deviation of a wheel's relative size error.
    * ``wheel_slip``: mean slip of all wheels, as a fraction of the distance.
    * ``wheels``: geometry with a wheel radius of 1 m, so that wheel rates are rim speeds in m/s.
    * ``unheard_mps2``, ``unheard_radps2``: assumed accelerations during a gap.
    """

    wheel_drift: float = 0.0035
    wheel_scale: float = 0.01
    wheel_slip: float = 0.02
    wheels: Kinematics = OmniKinematics(wheel_radius_m=1.0, base_radius_m=0.143)  # noqa: RUF009
    unheard_mps2: float = 1.0
    unheard_radps2: float = 5.0


@value(frozen=True, slots=True)
class Covariance:
    """Covariance of (x, y, yaw) in the odometry frame, in m², m·rad and rad²; symmetric."""

    xx: float = INITIAL_VARIANCE
    xy: float = 0.0
    x_yaw: float = 0.0
    yy: float = INITIAL_VARIANCE
    y_yaw: float = 0.0
    yaw_yaw: float = INITIAL_VARIANCE

    @classmethod
    def diagonal(cls, m2: float, rad2: float) -> "Covariance":
        """Return the covariance of independent errors, with the same variance in x and y."""
        return cls(m2, 0.0, 0.0, m2, 0.0, rad2)

    def __add__(self, other: "Covariance") -> "Covariance":
        """Return the covariance of the sum of two independent errors."""
        return Covariance(
            self.xx + other.xx,
            self.xy + other.xy,
            self.x_yaw + other.x_yaw,
            self.yy + other.yy,
            self.y_yaw + other.y_yaw,
            self.yaw_yaw + other.yaw_yaw,
        )

    def with_errors(self, errors: Iterable[tuple[float, float, float, float]]) -> "Covariance":
        """Return the covariance after adding independent errors, each as (variance, x, y, yaw).

        An error is the vector (x, y, yaw) times a random number with this variance.
        """
        xx = xy = x_yaw = yy = y_yaw = yaw_yaw = 0.0
        for variance, x, y, yaw in errors:
            along_x, along_y = variance * x, variance * y
            xx += along_x * x
            xy += along_x * y
            x_yaw += along_x * yaw
            yy += along_y * y
            y_yaw += along_y * yaw
            yaw_yaw += variance * yaw * yaw
        return Covariance(
            self.xx + xx,
            self.xy + xy,
            self.x_yaw + x_yaw,
            self.yy + yy,
            self.y_yaw + y_yaw,
            self.yaw_yaw + yaw_yaw,
        )

    @property
    def of_direction(self) -> "Covariance":
        """The covariance if the yaw is regarded as a direction, as in a quaternion.

        The yaw's variance is limited to that of an unknown direction. Its covariances are reduced
        in proportion.
        """
        if self.yaw_yaw <= UNKNOWN_YAW_VARIANCE:
            return self
        part = UNKNOWN_YAW_VARIANCE / self.yaw_yaw
        return Covariance(
            self.xx,
            self.xy,
            part * self.x_yaw,
            self.yy,
            part * self.y_yaw,
            UNKNOWN_YAW_VARIANCE,
        )

    def carried(self, dx_m: float, dy_m: float) -> "Covariance":
        """Return the covariance after a displacement given in the odometry frame.

        The error of the yaw adds to the error of the position.
        """
        return Covariance(
            xx=self.xx - 2 * dy_m * self.x_yaw + dy_m * dy_m * self.yaw_yaw,
            xy=self.xy + dx_m * self.x_yaw - dy_m * self.y_yaw - dx_m * dy_m * self.yaw_yaw,
            x_yaw=self.x_yaw - dy_m * self.yaw_yaw,
            yy=self.yy + 2 * dx_m * self.y_yaw + dx_m * dx_m * self.yaw_yaw,
            y_yaw=self.y_yaw + dx_m * self.yaw_yaw,
            yaw_yaw=self.yaw_yaw,
        )


NOTHING: Final = Covariance.diagonal(0.0, 0.0)


class Astray:
    """Two position errors, along and across the motion, that grow with the variance of the heading.

    They add to the error of ``Covariance.carried``, which is proportional to the heading's error.
    ``m2``: variance of x and of y, in m².
    """

    def __init__(self) -> None:
        self.m2 = 0.0
        self._along_m = (0.0, 0.0)
        """Covariances, in m, of x and y with the relative error of the last displacement.

        The relative error has no unit, and is scaled to variance 1.
        """
        self._rad2 = 0.0

    def move(self, dx_m: float, dy_m: float, rad2: float) -> None:
        """Add the errors of a displacement in the odometry frame.

        ``rad2``: variance of the heading. The faster this variance grows, the less a way back
        cancels the errors of the way out.
        """
        # while the variance does not grow, a way back cancels the errors of the way out
        kept = min(1.0, self._rad2 / rad2)
        part = min(1.0, ASTRAY * rad2)
        x_m, y_m = kept * self._along_m[0], kept * self._along_m[1]
        dx_m, dy_m = part * dx_m, part * dy_m
        self.m2 += dx_m * (dx_m + 2 * x_m) + dy_m * (dy_m + 2 * y_m)
        self._along_m, self._rad2 = (x_m + dx_m, y_m + dy_m), rad2


class Uncertainty:
    """The uncertainty of one odometry. The driver may replace ``noise`` at any time."""

    def __init__(self, noise: OdometryNoise) -> None:
        self.noise = noise
        self.gap = NOTHING
        self._halt = NOTHING
        self._walk = Covariance()
        self._astray = Astray()
        self._levers: list[tuple[float, float, float]] = []
        """For each wheel: the error of the pose (m, m, rad) if the relative error of the wheel's
        size is 1."""

    def move(self, heading_rad: float, tangent: Pose) -> None:
        """Move the body along a tangent (twist x time), and add the errors of the wheels.

        ``heading_rad``: heading before the move. The code uses plain numbers, because Pose objects
        are slow.
        """
        if not (tangent.x_m or tangent.y_m or tangent.yaw_rad):
            return
        heading_rad += tangent.yaw_rad / 2
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        dx_m = cos * tangent.x_m - sin * tangent.y_m
        dy_m = sin * tangent.x_m + cos * tangent.y_m
        wheels = self.noise.wheels
        alone = _alone(wheels)
        before = self._levers or [(0.0, 0.0, 0.0)] * len(alone)
        drift = self.noise.wheel_drift * self.noise.wheel_drift
        levers, errors = [], []
        for (lever_x_m, lever_y_m, lever_rad), rim_m, part in zip(
            before, wheels.wheel_rates(tangent.over(1.0)), alone, strict=True
        ):
            x_m = cos * part.x_m - sin * part.y_m
            y_m = sin * part.x_m + cos * part.y_m
            lever = (
                lever_x_m - dy_m * lever_rad + rim_m * x_m,
                lever_y_m + dx_m * lever_rad + rim_m * y_m,
                lever_rad + rim_m * part.yaw_rad,
            )
            levers.append(lever)
            errors.append((drift * abs(rim_m), x_m, y_m, part.yaw_rad))
        self._levers = levers
        self._walk = self._walk.carried(dx_m, dy_m).with_errors(errors)
        if self._walk.yaw_yaw > ASTRAY_RAD2:
            self._astray.move(dx_m, dy_m, self._walk.yaw_yaw)
        if self.gap is not NOTHING:
            self.gap = self.gap.carried(dx_m, dy_m)
        if self._halt is not NOTHING:
            self._halt = self._halt.carried(dx_m, dy_m)

    def miss(
        self, duration_s: float, fastest_mps: float, fastest_radps: float, counted_s: float = 0.0
    ) -> None:
        """Add the uncertainty of a gap of ``duration_s`` in the board's reports.

        The uncertainty is the possible deviation from a motion at constant speed. ``counted_s``:
        duration of the first part of this gap, whose uncertainty was added earlier.
        """
        self.gap += Covariance.diagonal(
            _unheard_variance(self.noise.unheard_mps2, fastest_mps, duration_s, counted_s),
            _unheard_variance(self.noise.unheard_radps2, fastest_radps, duration_s, counted_s),
        )

    def halt(self, way_m: float, turn_rad: float) -> None:
        """Add the uncertainty of a robot's motion until it came to rest when its board restarted.

        ``way_m``, ``turn_rad``: mean size of this motion. ``settle`` removes this uncertainty. The
        pose gate does not use this uncertainty.
        """
        variance = min(turn_rad * turn_rad, UNKNOWN_YAW_VARIANCE)
        self._halt += Covariance.diagonal(way_m * way_m, variance)

    def settle(self) -> None:
        """Remove the uncertainty of all gaps, because the motion in them is known now."""
        self.gap = self._halt = NOTHING

    def bound(self, way_m: float, turn_rad: float) -> None:
        """Set the uncertainty of all gaps to the error that the board's pose has shown.

        ``way_m``, ``turn_rad``: this error in m and rad. It stays uncorrected, because
        ``use_board_pose`` is False.
        """
        self.gap = Covariance.diagonal(way_m * way_m, turn_rad * turn_rad)
        self._halt = NOTHING

    def give_up(self) -> None:
        """Make the uncertainty of all gaps permanent, because the motion in them stays unknown.

        The added variance of the heading is at most that of an unknown heading.
        """
        self._walk += (self.gap + self._halt).of_direction
        self.gap = self._halt = NOTHING

    def total(self, open_error: Pose) -> Covariance:
        """Return the covariance of a pose.

        ``open_error``: the part of the pose's error that is known, but not corrected yet.
        """
        noise, levers = self.noise, self._levers
        scale = noise.wheel_scale * noise.wheel_scale
        slip = noise.wheel_slip * noise.wheel_slip
        alike = map(sum, zip(*levers, strict=True)) if levers else (0.0, 0.0, 0.0)
        wrong = open_error.x_m, open_error.y_m, open_error.yaw_rad
        known = self._walk if self.gap is NOTHING else self._walk + self.gap
        if self._halt is not NOTHING:
            known += self._halt
        if self._astray.m2:
            known += Covariance.diagonal(self._astray.m2, 0.0)
        return known.with_errors(
            (*((scale, *lever) for lever in levers), (slip, *alike), (1.0, *wrong))
        )


def _unheard_variance(acceleration: float, fastest: float, until_s: float, from_s: float) -> float:
    """Return by how much the variance of the motion in a gap grows while the gap gets longer.

    ``from_s``, ``until_s``: duration of the gap in s, before and after it gets longer.
    """
    # a robot that accelerates, and then brakes, deviates by at most a·t²/4
    before, after = (
        min(acceleration * duration_s * duration_s / 4, fastest * duration_s) ** 2
        for duration_s in (from_s, until_s)
    )
    return max(0.0, after - before)


@cache
def _alone(wheels: Kinematics) -> tuple[Pose, ...]:
    """Return, for each wheel, the body's motion if only this wheel rolls, by 1 m."""
    count = len(wheels.joints)
    rates = ([float(n == wheel) for n in range(count)] for wheel in range(count))
    return tuple(
        Pose(twist.vx_mps, twist.vy_mps, twist.yaw_rate_radps)
        for twist in map(wheels.body_twist, rates)
    )
