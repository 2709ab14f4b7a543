# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Judges the IMU: gravity and bias at rest, turns and vibration in motion."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from scipy import signal

from omnibot_driver.core.imu.gyro_calibration import STILL_MPS2, STILL_RADPS
from omnibot_driver.core.imu.scale import ACCEL_TOLERANCE, STANDARD_GRAVITY
from omnibot_driver.core.reporting.diagnosis import STUCK_READINGS
from omnibot_driver.tools.report.findings import Finding, Level, counted
from omnibot_driver.tools.report.log import Array, Log, Mask, Series
from omnibot_driver.tools.report.travel import SHORT_GAP_S, moving, steps

SLIGHT_ERROR: Final = 0.03
"""Relative error of measured gravity below which the accelerometer is judged good."""
REST_S: Final = 0.5
"""Time in s before and after each motion for which the robot is not regarded as at rest."""
LEAST_REST_S: Final = 1.0
BLOCK: Final = 100
TURNING_RADPS: Final = 0.1
"""Mean gyro reading in rad/s above which the robot is regarded as turning, if there is no odometry.
A smaller reading may be a bias."""
LARGEST_BIAS_RADPS: Final = 0.01
LARGEST_TILT_DEG: Final = 5.0
LEAST_TURN_RAD: Final = 1.5
TURN_TOLERANCE: Final = 0.05
MOSTLY: Final = 0.9
"""Fraction of the time between two odometry messages that gyro readings must cover. If they cover
less, the turns by gyro and by odometry are not compared for this time."""
STRONG_VIBRATION_MPS2: Final = 3.0
VIBRATION_HZ: Final = 5.0
"""Frequency in Hz up to which motion is regarded as caused by driving, not by vibration."""
SEGMENT: Final = 256


def rate_hz(imu: Series) -> float:
    """Return the rate of the IMU in Hz, from the median step of its timestamps."""
    if len(imu) < 2:
        return math.nan
    return float(np.round(1.0 / np.median(np.diff(imu.stamp_s)), 1))


def at_rest(log: Log, imu: Series) -> Mask:
    """Return, for each IMU reading, whether the robot was at rest according to the odometry.

    Without odometry, blocks of 100 IMU readings are judged by their mean and spread.
    """
    odom = log.odom.only(log.odom.finite & np.isfinite(log.odom.stamp_s))
    if len(odom) > 1:
        unheard = np.diff(odom.stamp_s) > SHORT_GAP_S
        restless = moving(odom)
        restless[1:] |= unheard
        restless[:-1] |= unheard
        edges = odom.stamp_s[restless]
        after = np.append(edges, np.inf)[np.searchsorted(edges, imu.stamp_s)]
        before = np.insert(edges, 0, -np.inf)[np.searchsorted(edges, imu.stamp_s)]
        known = (imu.stamp_s > odom.stamp_s[0]) & (imu.stamp_s < odom.stamp_s[-1])
        step = np.searchsorted(odom.stamp_s, imu.stamp_s) - 1
        known &= ~unheard[np.clip(step, 0, len(unheard) - 1)]
        return np.asarray(known & (after - imu.stamp_s > REST_S) & (imu.stamp_s - before > REST_S))
    rest = np.zeros(len(imu), dtype=bool)
    whole = len(imu) // BLOCK * BLOCK
    blocks = imu.values[:whole].reshape(-1, BLOCK, 6)
    spread = blocks.std(axis=1)
    still = (np.abs(blocks.mean(axis=1)[:, :3]) < TURNING_RADPS).all(axis=1)
    still &= (spread[:, :3] < STILL_RADPS).all(axis=1)
    still &= (spread[:, 3:] < STILL_MPS2).all(axis=1)
    rest[:whole] = np.repeat(still, BLOCK)
    return rest


@dataclass(frozen=True, slots=True)
class Spectrum:
    """Amplitude spectral densities per √Hz: one row for each frequency, with six columns.

    Columns: angular velocity about x, y, z; specific force along x, y, z.
    """

    frequency_hz: Array
    density: Array


def spectrum(imu: Series, rows: Mask) -> Spectrum | None:
    """Return Welch's mean spectrum of the selected ``rows``; None if there is too little data.

    Only pieces of at least 256 readings without gaps are used.
    """
    usual_hz = rate_hz(imu)
    breaks = np.flatnonzero(np.diff(imu.stamp_s) > 1.5 / usual_hz) + 1
    changes = np.flatnonzero(np.diff(rows.astype(np.int8))) + 1
    edges = np.unique(np.concatenate([[0], breaks, changes, [len(imu)]]))
    total, weight, frequency_hz = np.zeros((SEGMENT // 2 + 1, 6)), 0, np.empty(0)
    for first, last in pairwise(edges):
        if rows[first] and last - first >= SEGMENT:
            frequency_hz, power = signal.welch(
                imu.values[first:last], usual_hz, nperseg=SEGMENT, axis=0
            )
            total, weight = total + power * (last - first), weight + int(last - first)
    return Spectrum(frequency_hz[1:], np.sqrt(total[1:] / weight)) if weight else None


def judge(log: Log) -> Iterator[Finding]:
    """Judge the IMU: invalid numbers, stuck values, readings at rest, turns, and vibration."""
    broken = int((~log.imu.finite).sum())
    if broken:
        yield Finding(
            Level.BAD,
            "IMU",
            f"{counted(broken, 'message')} of imu/data_raw with NaN or infinity.",
            "This driver never publishes NaN or infinity: find out who else publishes"
            " imu/data_raw.",
        )
    imu = log.imu.only(log.imu.finite & np.isfinite(log.imu.stamp_s))
    if len(imu) < BLOCK:
        return
    stuck = [
        name
        for name, columns in (("gyro", slice(0, 3)), ("accelerometer", slice(3, 6)))
        if longest_same(imu.values[:, columns]) >= STUCK_READINGS
    ]
    if stuck:
        yield Finding(
            Level.BAD,
            "IMU",
            f"The {' and the '.join(stuck)} sent identical readings {STUCK_READINGS} times or more"
            " in a row.",
            "Switch the board off and on; if this continues, the sensor is broken.",
        )
    rest = at_rest(log, imu)
    if rest.sum() >= LEAST_REST_S * rate_hz(imu):
        yield from _gravity(log, imu.values[rest, 3:].mean(axis=0))
        if "gyro" not in stuck:
            yield from _bias(imu.values[rest, :3])
    else:
        yield Finding(
            Level.NOTE,
            "IMU",
            "The robot never stood still for long enough to judge gravity and bias.",
            "Record a few seconds at rest as well.",
        )
    if "gyro" not in stuck:
        yield from _turning(log, imu, rest)
    yield from _vibration(imu, rest)


def longest_same(values: Array) -> int:
    """Return the length of the longest run of equal rows in ``values``."""
    changes = np.flatnonzero((np.diff(values, axis=0) != 0.0).any(axis=1)) + 1
    return int(np.diff(np.concatenate([[0], changes, [len(values)]])).max())


def _gravity(log: Log, force: Array) -> Iterator[Finding]:
    norm = float(np.linalg.norm(force))
    figure = f"Gravity reads {norm:.3f} m/s² at rest; it should be {STANDARD_GRAVITY:.3f}"
    error = abs(norm / STANDARD_GRAVITY - 1.0)
    if error < SLIGHT_ERROR:
        yield Finding(Level.GOOD, "IMU", f"{figure}.")
    elif error < ACCEL_TOLERANCE:
        yield Finding(
            Level.NOTE, "IMU", f"{figure}.", "Set accel_bias: the accelerometer is slightly off."
        )
    else:
        yield Finding(Level.BAD, "IMU", f"{figure}.", _gravity_advice(log, norm))
    if norm > 0.5 * STANDARD_GRAVITY:
        tilt_deg = float(np.degrees(np.arccos(min(1.0, abs(force[2]) / norm))))
        figure = f"At rest the sensor is tilted by {tilt_deg:.1f}°"
        if tilt_deg > LARGEST_TILT_DEG:
            yield Finding(
                Level.WARN,
                "IMU",
                f"{figure}.",
                "Put the robot on level ground. If the ground in this recording was level, set"
                " imu_rpy in the description.",
            )
        else:
            yield Finding(Level.GOOD, "IMU", f"{figure}.")


def _gravity_advice(log: Log, norm: float) -> str:
    if log.two_wheels:
        return "Check acceleration_unit and accel_calibration, and that nothing shook the robot."
    factor = STANDARD_GRAVITY / max(norm, 1e-3)
    if any(abs(factor / g - 1) < 0.1 or abs(factor * g - 1) < 0.1 for g in (2, 4, 8)):
        return f"Set accel_range to {factor:.3g} times its present value."
    return "Check accel_range and accel_bias, and that nothing shook the robot."


def _bias(gyro: Array) -> Iterator[Finding]:
    bias, noise = gyro.mean(axis=0), gyro.std(axis=0)
    axis = int(np.abs(bias).argmax())
    figure = (
        f"At rest the gyro reads {bias[axis]:+.4f} rad/s about {'xyz'[axis]}"
        f" ({abs(np.degrees(bias[axis]) * 60):.0f}° a minute), with a noise of"
        f" {noise.max():.4f} rad/s rms"
    )
    if abs(bias[axis]) > LARGEST_BIAS_RADPS:
        yield Finding(
            Level.WARN, "IMU", f"{figure}.", "Call ~/calibrate_gyro while the robot stands still."
        )
    else:
        yield Finding(Level.GOOD, "IMU", f"{figure}.")


def turned(log: Log, imu: Series, rest: Mask) -> tuple[float, float] | None:
    """Return the ratio of turns by gyro to turns by odometry, and the sum of all turns in rad.

    Left and right turns both increase the sum. None if the odometry has no turns.
    """
    odom = log.odom.only(log.odom.finite & np.isfinite(log.odom.stamp_s))
    if len(odom) < 2:
        return None
    rate = imu.values[:, 2] - (imu.values[rest, 2].mean() if rest.any() else 0.0)
    steps_s = np.diff(imu.stamp_s, prepend=imu.stamp_s[0])
    heard_s = np.where(steps_s < SHORT_GAP_S, steps_s, 0.0)
    angle, heard = (
        np.diff(np.interp(odom.stamp_s, imu.stamp_s, np.cumsum(column)))
        for column in (rate * heard_s, heard_s)
    )
    between_s = np.diff(odom.stamp_s)
    known = (between_s < SHORT_GAP_S) & (heard > MOSTLY * between_s)
    by_wheels, by_gyro = steps(odom).turned_rad[known], angle[known]
    total = float(np.abs(by_wheels).sum())
    square = float((by_wheels**2).sum())
    return (float((by_wheels * by_gyro).sum()) / square, total) if square else None


def _turning(log: Log, imu: Series, rest: Mask) -> Iterator[Finding]:
    found = turned(log, imu, rest)
    if found is None or found[1] < LEAST_TURN_RAD:
        return
    ratio, total = found
    figure = (
        f"The turns by the gyro are {abs(ratio):.3f} times the turns in odom"
        f" ({np.degrees(total):.0f}° in all)"
    )
    mountings = {True: "is mounted upright", False: "hangs upside down"}
    upright, described_upright = ratio > 0.0, log.two_wheels
    if abs(abs(ratio) - 1.0) > TURN_TOLERANCE:
        sizes = "wheel_radii and track" if log.two_wheels else "base_radius and gyro_range"
        yield Finding(
            Level.WARN, "IMU", f"{figure}.", f"Check {sizes}, and whether the wheels slip."
        )
    elif upright == described_upright:
        yield Finding(
            Level.GOOD,
            "IMU",
            f"{figure}. The sensor {mountings[upright]}, as in the robot's description.",
        )
    else:
        sign = "the same sign as" if upright else "the opposite sign to"
        described = "upright" if described_upright else "upside down"
        yield Finding(
            Level.NOTE,
            "IMU",
            f"{figure}. The gyro has {sign} odom, so the sensor {mountings[upright]}.",
            f"The robot's description has the sensor {described}: set imu_rpy in the description.",
        )


def _vibration(imu: Series, rest: Mask) -> Iterator[Finding]:
    if (~rest).sum() < LEAST_REST_S * rate_hz(imu):
        return
    moved = spectrum(imu, ~rest)
    if moved is None:
        return
    above = moved.frequency_hz > VIBRATION_HZ
    power = (moved.density[above, 3:] ** 2).sum(axis=1)
    width_hz = float(moved.frequency_hz[1] - moved.frequency_hz[0])
    rms = float(np.sqrt(power.sum() * width_hz))
    figure = (
        f"In motion the robot shakes by {rms:.2f} m/s² rms above {VIBRATION_HZ:g} Hz,"
        f" most at {moved.frequency_hz[above][power.argmax()]:.1f} Hz"
    )
    if rms > STRONG_VIBRATION_MPS2:
        yield Finding(
            Level.WARN,
            "IMU",
            f"{figure}.",
            "Look for a loose wheel or roller, a bent axle or rough ground.",
        )
    else:
        yield Finding(Level.GOOD, "IMU", f"{figure}.")
