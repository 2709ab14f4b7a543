# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The evaluation of an IMU at rest: its biases, its noise, and the upward direction.

Only the part of the accelerometer's bias along gravity is found; the part at right angles to
gravity looks like a tilt. This module does not know how readings are recorded.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from omnibot_driver.core.imu.gyro_calibration import Look
from omnibot_driver.tools.calibrate.allan import Allan, Noise, allan, noise
from omnibot_driver.tools.calibrate.log import Column, Imu, Log
from omnibot_driver.tools.needs import ToolError

BLOCK_S: Final = 1.0
"""Length of a block of readings, in s.

Scatter within blocks shows noise. Scatter of the blocks' means shows drift.
"""
FEWEST: Final = 100
LOST_PART: Final = 0.02


@dataclass(frozen=True, slots=True)
class Rest:
    """The evaluation of an IMU at rest. Arrays have one value for each of the sensor's axes.

    * ``bias_sigma``: standard deviation of the gyro's bias at the end of the measurement.
    * ``rate_noise``, ``force_noise``: standard deviation of a single reading.
    * ``curves``, ``noises``: the gyro's Allan deviations and fitted noise terms.
    """

    bias_radps: Column
    bias_sigma: Column
    rate_noise: Column
    force_mps2: Column
    force_sigma: Column
    force_noise: Column
    readings: int
    period_s: float
    curves: tuple[Allan, ...]
    noises: tuple[Noise, ...]

    @property
    def up(self) -> Column:
        """The upward direction, as a unit vector in the sensor's axes."""
        return np.asarray(self.force_mps2 / np.linalg.norm(self.force_mps2))

    @property
    def gravity_mps2(self) -> float:
        """Magnitude of the mean specific force, in m/s²."""
        return float(np.linalg.norm(self.force_mps2))

    @property
    def level_rad(self) -> tuple[float, float]:
        """Roll and pitch of the sensor in rad, about fixed axes, if the floor is level."""
        x, y, z = self.force_mps2
        return float(np.arctan2(y, z)), float(np.arctan2(-x, np.hypot(y, z)))

    @property
    def level_sigma_rad(self) -> float:
        """Standard deviation of roll and pitch in rad, due to the noise alone."""
        return float(self.force_sigma.max() / self.gravity_mps2)


def rest(imu: Imu) -> Rest:
    """Evaluate the readings of an IMU at rest.

    Raises ToolError if readings are too few, lost or not finite, or if an axis is stuck.
    """
    rates, forces = imu.rate_radps, imu.force_mps2
    if len(rates) < FEWEST:
        raise ToolError(
            f"{len(rates)} IMU readings are too few: let the robot rest for at least a second"
        )
    if not (np.isfinite(rates).all() and np.isfinite(forces).all()):
        raise ToolError("the IMU's readings are not all finite: see what the driver logs")
    period_s = float(np.median(np.diff(imu.stamp_s)))
    lost = 1 - (len(rates) - 1) * period_s / (imu.stamp_s[-1] - imu.stamp_s[0])
    if lost > LOST_PART:
        raise ToolError(
            f"{lost:.0%} of the IMU readings were lost: see the rates in /diagnostics, then try"
            " again"
        )
    if not (np.ptp(rates, axis=0).all() and np.ptp(forces, axis=0).all()):
        raise ToolError(
            "an axis of the IMU is stuck, because all its readings are identical: switch the board"
            " off and on"
        )
    size = max(2, round(BLOCK_S / period_s))
    rate_noise, force_noise = _within(rates, size), _within(forces, size)
    curves = tuple(allan(axis, period_s) for axis in rates.T)
    noises = tuple(noise(curve) for curve in curves)
    walked = np.array([one.walk for one in noises]) * np.sqrt(len(rates) * period_s / 3)
    return Rest(
        rates.mean(axis=0),
        np.hypot(_of_mean(rates, rate_noise, size), walked),
        rate_noise,
        forces.mean(axis=0),
        _of_mean(forces, force_noise, size),
        force_noise,
        len(rates),
        period_s,
        curves,
        noises,
    )


def still(bias_radps: Column) -> Callable[[Log], None]:
    """Return a function that checks a growing log, and raises ToolError if the robot moves.

    ``bias_radps``: the bias that the driver has subtracted from the gyro's readings.
    """
    seen = [0, 0]
    look = Look()

    def ask(log: Log) -> None:
        nonlocal look
        for stamp_s, *reading in log.imu_rows[seen[0] :]:
            x, y, z = np.array(reading[3:]) + bias_radps
            look.hear((float(x), float(y), float(z)), (reading[0], reading[1], reading[2]), stamp_s)
        for before, after in zip(
            log.odometry_rows[max(0, seen[1] - 1) :],
            log.odometry_rows[max(1, seen[1]) :],
            strict=False,
        ):
            look.displaced(after[1] - before[1], after[2] - before[2], after[3] - before[3])
        seen[:] = len(log.imu_rows), len(log.odometry_rows)
        if look.length_s >= BLOCK_S:
            motion, look = look.motion, Look()
            if motion:
                raise ToolError(f"the robot moves ({motion}): let it stand still and begin again")

    return ask


def _within(readings: Column, size: int) -> Column:
    """Return the standard deviation of readings from the mean of their block, for each axis.

    Each block has ``size`` readings.
    """
    blocks = _blocks(readings, size)
    return np.asarray(np.sqrt(blocks.var(axis=1, ddof=1).mean(axis=0)))


def _of_mean(readings: Column, noise: Column, size: int) -> Column:
    """Return the standard deviation of the mean of ``readings``, for each axis.

    It is the larger of two estimates: from single readings, and from the means of blocks.
    """
    means = _blocks(readings, size).mean(axis=1)
    white = noise / np.sqrt(len(readings))
    if len(means) < 5:
        return np.asarray(white)
    return np.asarray(np.maximum(white, means.std(axis=0, ddof=1) / np.sqrt(len(means))))


def _blocks(readings: Column, size: int) -> Column:
    count = max(1, len(readings) // size)
    whole = readings[: count * size] if len(readings) >= size else readings
    return whole.reshape(count, -1, readings.shape[1])
