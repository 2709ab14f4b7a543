# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A log of a robot's data and commands during one motion or one rest, as columns.

Times are in seconds of ROS's clock; the time of a measurement is its sampling time. Must not use
ROS.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Column = NDArray[np.float64]
Row = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Imu:
    """IMU readings: ``force_mps2`` and ``rate_radps`` of shape (n, 3), in the sensor's axes."""

    stamp_s: Column
    force_mps2: Column
    rate_radps: Column


@dataclass(frozen=True, slots=True)
class Odometry:
    """Odometry: ``pose`` (n, 3) in m, m and unwrapped rad; body ``twist`` (n, 3) in m/s and
    rad/s."""

    stamp_s: Column
    pose: Column
    twist: Column


@dataclass(frozen=True, slots=True)
class Wheels:
    """Wheel data: ``angle_rad`` and ``rate_radps``, (n, wheels), in the order of
    ``joint_states``."""

    stamp_s: Column
    angle_rad: Column
    rate_radps: Column


@dataclass(frozen=True, slots=True)
class Commands:
    """Commands with sending times; ``values``: (n, 3) in m/s and rad/s, or wheel rates in rad/s."""

    stamp_s: Column
    values: Column


@dataclass(slots=True)
class Log:
    """Received data and sent commands: rows in order of time; the properties return columns."""

    imu_rows: list[Row] = field(default_factory=list)
    odometry_rows: list[Row] = field(default_factory=list)
    wheel_rows: list[Row] = field(default_factory=list)
    command_rows: list[Row] = field(default_factory=list)

    @property
    def imu(self) -> Imu:
        """The IMU rows as columns; a row is a timestamp, three forces and three rates."""
        rows = _columns(self.imu_rows, 7)
        return Imu(rows[:, 0], rows[:, 1:4], rows[:, 4:7])

    @property
    def odometry(self) -> Odometry:
        """The odometry rows as columns; a row is a timestamp, a pose and a twist."""
        rows = _columns(self.odometry_rows, 7)
        pose = rows[:, 1:4].copy()
        pose[:, 2] = np.unwrap(pose[:, 2])
        return Odometry(rows[:, 0], pose, rows[:, 4:7])

    @property
    def wheels(self) -> Wheels:
        """The wheel rows as columns; a row is a timestamp, angles and rates (NaN: not reported)."""
        wheels = len(self.wheel_rows[0]) // 2 if self.wheel_rows else 0
        rows = _columns(self.wheel_rows, 1 + 2 * wheels)
        return Wheels(rows[:, 0], rows[:, 1 : 1 + wheels], rows[:, 1 + wheels :])

    @property
    def commands(self) -> Commands:
        """The command rows as columns; a row is a time and three values."""
        rows = _columns(self.command_rows, 4)
        return Commands(rows[:, 0], rows[:, 1:4])


def _columns(rows: Sequence[Row], width: int) -> Column:
    return np.array(rows, dtype=np.float64).reshape(len(rows), width)
