# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What was heard of a robot and told to it during one motion or one rest, as columns.

Times are in seconds by ROS's clock; those of measurements are when the board sampled. Knows no ROS.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Column = NDArray[np.float64]
Row = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Imu:
    """IMU data: ``force_mps2`` and ``rate_radps`` of shape (n, 3), in the sensor's axes."""

    stamp_s: Column
    force_mps2: Column
    rate_radps: Column


@dataclass(frozen=True, slots=True)
class Odometry:
    """``pose``: (n, 3), m, m and unwrapped rad; ``twist``: (n, 3), m/s and rad/s in the body."""

    stamp_s: Column
    pose: Column
    twist: Column


@dataclass(frozen=True, slots=True)
class Wheels:
    """``angle_rad`` and ``rate_radps``: (n, wheels), in the order of ``joint_states``."""

    stamp_s: Column
    angle_rad: Column
    rate_radps: Column


@dataclass(frozen=True, slots=True)
class Commands:
    """``values``: (n, 3), a twist in m/s and rad/s or wheel rates in rad/s, when it was sent."""

    stamp_s: Column
    values: Column


@dataclass(slots=True)
class Log:
    """Rows in order of arrival; columns for calculations."""

    imu_rows: list[Row] = field(default_factory=list)
    odometry_rows: list[Row] = field(default_factory=list)
    wheel_rows: list[Row] = field(default_factory=list)
    command_rows: list[Row] = field(default_factory=list)

    @property
    def imu(self) -> Imu:
        """The IMU rows: a stamp, three forces and three rates each."""
        rows = _columns(self.imu_rows, 7)
        return Imu(rows[:, 0], rows[:, 1:4], rows[:, 4:7])

    @property
    def odometry(self) -> Odometry:
        """The odometry rows: a stamp, a pose and a twist each."""
        rows = _columns(self.odometry_rows, 7)
        pose = rows[:, 1:4].copy()
        pose[:, 2] = np.unwrap(pose[:, 2])
        return Odometry(rows[:, 0], pose, rows[:, 4:7])

    @property
    def wheels(self) -> Wheels:
        """Rows of a stamp, angles and as many rates (NaN where the driver gave none)."""
        wheels = len(self.wheel_rows[0]) // 2 if self.wheel_rows else 0
        rows = _columns(self.wheel_rows, 1 + 2 * wheels)
        return Wheels(rows[:, 0], rows[:, 1 : 1 + wheels], rows[:, 1 + wheels :])

    @property
    def commands(self) -> Commands:
        """The command rows: a time and three values each."""
        rows = _columns(self.command_rows, 4)
        return Commands(rows[:, 0], rows[:, 1:4])


def _columns(rows: Sequence[Row], width: int) -> Column:
    return np.array(rows, dtype=np.float64).reshape(len(rows), width)
