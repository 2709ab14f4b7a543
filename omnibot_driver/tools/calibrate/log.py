# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A log of the robot's data and commands in one motion, or of data without commands.

Sampling times of data and sending times of commands are in s, by ROS's clock. This module does not
know ROS.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Column = NDArray[np.float64]
Row = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Imu:
    """IMU readings in the sensor's axes.

    ``force_mps2``, ``rate_radps``: specific forces and rates of rotation, both (n, 3).
    """

    stamp_s: Column
    force_mps2: Column
    rate_radps: Column


@dataclass(frozen=True, slots=True)
class Odometry:
    """The odometry that the driver published. Both arrays have the shape (n, 3).

    ``pose``: m, m and unwrapped rad.

    ``twist``: in the body's axes, m/s, m/s and rad/s.
    """

    stamp_s: Column
    pose: Column
    twist: Column


@dataclass(frozen=True, slots=True)
class Wheels:
    """The angles and rates of the wheels, in the order of ``joint_states``.

    ``angle_rad``, ``rate_radps``: both (n, number of wheels).
    """

    stamp_s: Column
    angle_rad: Column
    rate_radps: Column


@dataclass(frozen=True, slots=True)
class Commands:
    """The commands, and the times at which they were sent.

    ``values``: (n, 3), either velocities in m/s, m/s and rad/s, or wheel rates in rad/s.
    """

    stamp_s: Column
    values: Column


@dataclass(slots=True)
class Log:
    """The received data and the sent commands, as rows of numbers in order of time.

    The properties return the rows as columns.
    """

    imu_rows: list[Row] = field(default_factory=list)
    odometry_rows: list[Row] = field(default_factory=list)
    wheel_rows: list[Row] = field(default_factory=list)
    command_rows: list[Row] = field(default_factory=list)

    @property
    def imu(self) -> Imu:
        """The IMU's rows as columns. A row is a timestamp, three forces and three rates."""
        rows = _columns(self.imu_rows, 7)
        return Imu(rows[:, 0], rows[:, 1:4], rows[:, 4:7])

    @property
    def odometry(self) -> Odometry:
        """The odometry's rows as columns. A row is a timestamp, a pose and a twist."""
        rows = _columns(self.odometry_rows, 7)
        pose = rows[:, 1:4].copy()
        pose[:, 2] = np.unwrap(pose[:, 2])
        return Odometry(rows[:, 0], pose, rows[:, 4:7])

    @property
    def wheels(self) -> Wheels:
        """The recorded wheel states as arrays: timestamps, angles and rates (NaN if missing)."""
        wheels = len(self.wheel_rows[0]) // 2 if self.wheel_rows else 0
        rows = _columns(self.wheel_rows, 1 + 2 * wheels)
        return Wheels(rows[:, 0], rows[:, 1 : 1 + wheels], rows[:, 1 + wheels :])

    @property
    def commands(self) -> Commands:
        """The recorded commands as two arrays: times in s, and three values for each command."""
        rows = _columns(self.command_rows, 4)
        return Commands(rows[:, 0], rows[:, 1:4])


def _columns(rows: Sequence[Row], width: int) -> Column:
    return np.array(rows, dtype=np.float64).reshape(len(rows), width)
