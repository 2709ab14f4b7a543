# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Plan commands, measure the speeds that result, and fit the scale.

A *count* is the unit of the board's commands. Here, each command is a whole number of counts. This
module does not know the robot.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from omnibot_driver.core.readings import Vector3
from omnibot_driver.tools.calibrate.log import Column, Log
from omnibot_driver.tools.needs import ToolError

SETTLE_S: Final = 1.2
"""Time from a command to a steady speed, in s. After 1 s, the speed still differs by 0.1 %."""
REPEATED_WITHIN_S: Final = 0.2
FEWEST: Final = 5
LEAST_SIGMA: Final = 1e-4
"""Lower limit of two estimated standard deviations: that of a pose, in m or rad, and that of the
gyro's mean rate, in rad/s."""
CORRECTED_WITH: Final = 5
"""Number of successive odometry steps that count as one measurement. The driver spreads a
correction of the pose over these steps."""


@dataclass(frozen=True, slots=True)
class Speed:
    """One steady speed along an axis, in m/s or rad/s.

    * ``axis``: 0 for x, 1 for y, 2 for yaw.
    * ``counts``: the commanded counts.
    * ``measured``, ``sigma``: speed by the odometry, and its standard deviation.
    * ``gyro``, ``gyro_sigma``: the same by the gyro; ``gyro`` is NaN for x and y.
    """

    axis: int
    counts: int
    measured: float
    sigma: float
    gyro: float
    gyro_sigma: float


@dataclass(frozen=True, slots=True)
class Scale:
    """A scale in counts per m/s, or in counts per rad/s.

    ``sigma``: standard deviation of ``value``.

    ``excess``: scatter of the speeds, divided by the expected scatter.
    """

    value: float
    sigma: float
    excess: float


def plan(top: Vector3, scales: Vector3, levels: int, seconds: float) -> list[tuple[float, Vector3]]:
    """Return pairs of a duration in s and a command, in both directions along each axis.

    * ``top``: largest speeds.
    * ``scales``: counts per m/s or rad/s.
    * ``levels``: number of speeds per axis.
    """
    stairs = []
    for level in range(1, levels + 1):
        for axis in range(3):
            counts = max(1, int(top[axis] * scales[axis] * level / levels + 1e-9))
            for sign in (1, -1):
                command = [0.0, 0.0, 0.0]
                command[axis] = sign * counts / scales[axis]
                stairs.append((seconds, (command[0], command[1], command[2])))
    return stairs


def speeds(log: Log, scales: Vector3, up: Column, bias: Column) -> list[Speed]:
    """Return one measured speed for each command that stayed the same for long enough.

    * ``scales``: counts per m/s or rad/s, for x, y and yaw.
    * ``up``, ``bias``: upward direction and gyro bias (rad/s), in the sensor's axes.

    Raises ToolError if the log has no steady speed.
    """
    odometry, imu = log.odometry, log.imu
    found = []
    for began_s, ended_s, command in _held(log):
        axis = int(np.argmax(np.abs(command)))
        within = _within(odometry.stamp_s, began_s, ended_s)
        turned = (imu.rate_radps[_within(imu.stamp_s, began_s, ended_s)] - bias) @ up
        if within.sum() < FEWEST or len(turned) < FEWEST:
            continue
        way = _way(odometry.pose[within], axis)
        # Each twist has the rounding error of a single displacement. In poses, rounding errors do
        # not accumulate.
        measured, sigma = _slope(odometry.stamp_s[within], way)
        found.append(
            Speed(
                axis,
                round(float(command[axis]) * scales[axis]),
                measured,
                sigma,
                float(turned.mean()) if axis == 2 else np.nan,
                max(LEAST_SIGMA, _of_mean(turned)),
            )
        )
    if not found or not all(np.isfinite([one.measured, one.sigma]).all() for one in found):
        raise ToolError("no steady speed could be measured: see the rates in /diagnostics")
    return found


def scale(found: Sequence[Speed], by: Literal["odometry", "gyro"] = "odometry") -> Scale:
    """Return the scale that fits the speeds best. Their uncertainties determine their weights.

    Raises ToolError if the robot moved in the opposite direction to its commands.
    """
    counts = np.array([one.counts for one in found], dtype=float)
    measured = np.array([one.measured if by == "odometry" else one.gyro for one in found])
    sigma = np.array([one.sigma if by == "odometry" else one.gyro_sigma for one in found])
    weight = 1 / sigma**2
    information = float((weight * counts**2).sum())
    per_count = float((weight * counts * measured).sum() / information)
    if per_count <= 0.0:
        raise ToolError(
            "the robot drives in the opposite direction to its commands: set `axis_signs` first"
            " (docs/commissioning.md)"
        )
    freedom = max(1, len(found) - 1)
    misfit = float((weight * (measured - per_count * counts) ** 2).sum()) / freedom
    excess = max(1.0, misfit) ** 0.5
    return Scale(1 / per_count, excess / information**0.5 / per_count**2, excess)


def _held(log: Log) -> list[tuple[float, float, Column]]:
    """Return the time spans of steady speed as (begin in s, end in s, command).

    Zero commands are omitted. A pause of more than 0.2 s (``REPEATED_WITHIN_S``) ends a span.
    """
    commands = log.commands
    if not len(commands.stamp_s):
        return []
    other = np.any(np.diff(commands.values, axis=0), axis=1)
    changes = np.flatnonzero(other | (np.diff(commands.stamp_s) > REPEATED_WITHIN_S)) + 1
    firsts, lasts = [0, *changes], [*changes - 1, len(commands.stamp_s) - 1]
    return [
        (commands.stamp_s[first] + SETTLE_S, commands.stamp_s[last], commands.values[first])
        for first, last in zip(firsts, lasts, strict=True)
        if commands.values[first].any()
        and commands.stamp_s[last] - commands.stamp_s[first] > SETTLE_S
    ]


def _within(stamp_s: Column, began_s: float, ended_s: float) -> Column:
    return np.asarray((stamp_s > began_s) & (stamp_s <= ended_s))


def _way(pose: Column, axis: int) -> Column:
    """Return, for each pose, the coordinate along an axis of the robot, or the yaw.

    ``axis``: 0 for x, 1 for y, 2 for the yaw. The axes are those at the robot's mean heading.
    """
    if axis == 2:
        return np.asarray(pose[:, 2])
    heading_rad = pose[:, 2].mean() + axis * np.pi / 2
    return np.asarray(pose[:, 0] * np.cos(heading_rad) + pose[:, 1] * np.sin(heading_rad))


def _slope(stamp_s: Column, way: Column) -> tuple[float, float]:
    """Return the slope of a line fitted to distance over time, and its standard deviation."""
    off_s = stamp_s - stamp_s.mean()
    speed = float(off_s @ way / (off_s @ off_s))
    left = way - way.mean() - speed * off_s
    spread = max(LEAST_SIGMA, float(np.sqrt(left @ left / (len(way) - 2))))
    return speed, spread * float(np.sqrt(CORRECTED_WITH / (off_s @ off_s)))


def _of_mean(values: Column) -> float:
    return float(values.std(ddof=1) / np.sqrt(len(values)))
