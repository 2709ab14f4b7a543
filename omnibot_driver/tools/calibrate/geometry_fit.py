# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Fit the robot's geometry to drives whose ends the user measured with a tape.

Method: J. Borenstein and L. Feng, "UMBmark" (1995), extended to three wheels. This module does not
know how the robot was driven.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import least_squares

from omnibot_driver.core.geometry.omni import OmniKinematics
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.tools.calibrate.log import Column
from omnibot_driver.tools.needs import ToolError

WHEELS_ALIKE: Final = 0.01
"""Assumed relative standard deviation of the wheels' radii, due to manufacturing tolerances."""
UNKNOWN: Final = 0.2
"""Largest accepted relative difference between a fitted and an assumed radius. If the difference is
larger, the user's measurements are regarded as wrong."""


@dataclass(frozen=True, slots=True)
class Reading:
    """One drive with the user's measurement. Poses are x and y in m, and the unwrapped yaw in rad.

    * ``path``: odometry poses, (n, 3), until the robot is at rest.
    * ``end``: the measured end relative to the start, (3,); NaN if not measured.
    * ``sigma``: standard deviations of ``end``, (3,).
    """

    name: str
    path: Column
    end: Column
    sigma: Column


@dataclass(frozen=True, slots=True)
class Geometry:
    """The robot's sizes, as ratios to the assumed sizes.

    * ``wheels``: mean radius of the wheels.
    * ``base``: base radius.
    * ``unlike``: relative deviation of each wheel's radius from the mean, (3,).
    * ``covariance``: covariance of ``wheels``, ``base``, ``unlike[:2]``, (4, 4).
    * ``excess``: residuals divided by the expected residuals, at least 1.
    """

    wheels: float
    base: float
    unlike: Column
    covariance: Column
    excess: float

    @property
    def turn(self) -> float:
        """Ratio of the true angle of a turn to the angle computed with the assumed sizes."""
        return self.wheels / self.base

    @property
    def turn_sigma(self) -> float:
        """Standard deviation of the ratio of the true angle of a turn to the computed angle."""
        slope = np.array([1 / self.base, -self.wheels / self.base**2, 0.0, 0.0])
        return _sigma(slope, self.covariance)

    @property
    def unlike_sigma(self) -> Column:
        """Standard deviation of each wheel's relative deviation from the mean radius, (3,)."""
        slopes = np.array([[0, 0, 1, 0], [0, 0, 0, 1], [0, 0, -1, -1]], dtype=float)
        return np.array([_sigma(slope, self.covariance) for slope in slopes])


def fit(readings: Sequence[Reading], base_radius_m: float, drift: float) -> Geometry:
    """Return the geometry that explains the readings best.

    ``drift``: standard deviation, in m, that slip causes in a wheel's distance of 1 m.

    Raises ToolError if the fit fails, or changes a size by more than 20 % (``UNKNOWN``).
    """

    weights = [_weights(reading, base_radius_m, drift) for reading in readings]
    rims = [rims_of(reading.path, base_radius_m) for reading in readings]

    def misfit(sizes: Column) -> Column:
        wheels, base, a, b = sizes
        factors = wheels * (1 + np.array([a, b, -a - b]))
        parts = [np.array([a, b, a + b]) / WHEELS_ALIKE]
        for reading, rim, weight in zip(readings, rims, weights, strict=True):
            off = _rolled(rim, factors, base * base_radius_m)[-1] - reading.end
            parts.append(weight @ off[~np.isnan(reading.end)])
        return np.concatenate(parts)

    count = sum(int((~np.isnan(reading.end)).sum()) for reading in readings)
    found = least_squares(misfit, np.array([1.0, 1.0, 0.0, 0.0]), x_scale=(0.01, 0.01, 0.01, 0.01))
    wheels, base, a, b = found.x
    if not found.success or max(abs(wheels - 1), abs(base - 1)) > UNKNOWN:
        raise ToolError(
            "the readings do not fit this robot (wheel or base radius off by more than"
            f" {UNKNOWN:.0%}): check the signs and units of the readings, and that a forward"
            " command drives the robot forward, then try again"
        )
    excess = max(1.0, 2 * found.cost / max(1, count + 3 - 4)) ** 0.5
    covariance = excess**2 * np.linalg.inv(found.jac.T @ found.jac)
    return Geometry(float(wheels), float(base), np.array([a, b, -a - b]), covariance, excess)


def rolled(path: Column, factors: Column, base: float, base_radius_m: float) -> Column:
    """Return the path that the same wheel angles give with other radii, from the origin, (n, 3).

    * ``path``: poses that were computed with the assumed radii.
    * ``factors``: new / assumed radius of each wheel, (3,) or, for each step, (n - 1, 3).
    * ``base``: new / assumed base radius.
    """
    return _rolled(rims_of(path, base_radius_m), factors, base * base_radius_m)


def _rolled(rims: Column, factors: Column, base_radius_m: float) -> Column:
    """Return the poses of a path that begins at the origin, (n, 3).

    ``rims``: distance that each wheel rolls in each step, by the assumed radii, in m, (n - 1, 3).
    """
    body = rims * factors @ np.linalg.inv(_rims(base_radius_m)).T
    yaw = np.concatenate(([0.0], np.cumsum(body[:, 2])))
    middle = yaw[:-1] + body[:, 2] / 2
    cos, sin = np.cos(middle), np.sin(middle)
    x = np.cumsum(cos * body[:, 0] - sin * body[:, 1])
    y = np.cumsum(sin * body[:, 0] + cos * body[:, 1])
    return np.stack((np.concatenate(([0.0], x)), np.concatenate(([0.0], y)), yaw), axis=1)


def rims_of(path: Column, base_radius_m: float) -> Column:
    """Return the distance that each wheel rolled between successive poses, in m, (n - 1, 3)."""
    steps = np.diff(path, axis=0)
    middle = path[:-1, 2] + steps[:, 2] / 2
    cos, sin = np.cos(middle), np.sin(middle)
    body = (cos * steps[:, 0] + sin * steps[:, 1], cos * steps[:, 1] - sin * steps[:, 0])
    return np.asarray(np.stack((*body, steps[:, 2]), axis=1) @ _rims(base_radius_m).T)


def _weights(reading: Reading, base_radius_m: float, drift: float) -> Column:
    """Return the matrix that makes a reading's errors independent, with a variance of 1."""
    path = reading.path
    x, y, yaw = np.linalg.inv(_rims(base_radius_m))
    middle = (path[:-1, 2] + path[1:, 2]) / 2
    cos, sin = np.cos(middle)[:, None], np.sin(middle)[:, None]
    left_x, left_y = (path[-1, :2] - path[1:, :2]).T[:, :, None]
    slopes = np.stack(  # (3, n - 1, 3): derivatives of the end by the distances in each step
        (cos * x - sin * y - left_y * yaw, sin * x + cos * y + left_x * yaw, 0 * cos + yaw)
    )
    variance = drift**2 * np.abs(rims_of(path, base_radius_m))
    covariance = np.einsum("aik,ik,bik->ab", slopes, variance, slopes) + np.diag(reading.sigma**2)
    measured = ~np.isnan(reading.end)
    root = np.linalg.cholesky(covariance[np.ix_(measured, measured)])
    return np.asarray(np.linalg.inv(root))


def _rims(base_radius_m: float) -> Column:
    """Return the (3, 3) matrix that converts a body twist to the rim speeds of the wheels."""
    wheels = OmniKinematics(1.0, base_radius_m)
    columns = [BodyTwist(1.0, 0.0, 0.0), BodyTwist(0.0, 1.0, 0.0), BodyTwist(0.0, 0.0, 1.0)]
    return np.array([wheels.wheel_rates(column) for column in columns]).T


def _sigma(slope: Column, covariance: Column) -> float:
    return math.sqrt(float(slope @ covariance @ slope))
