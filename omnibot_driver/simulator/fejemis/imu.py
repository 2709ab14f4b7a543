# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The IMU on the drive Teensy: gyro, accelerometer, magnetometer, orientation and calibration.

This module knows the true motion of the robot. It must not know the lines of the protocol.
"""

from collections.abc import Iterator
from math import cos, degrees, pi, radians, sin
from random import Random
from typing import Any

from omnibot_driver.simulator.fejemis.config import DriveConfig, Vector
from omnibot_driver.simulator.fejemis.settings import FejemisSettings
from omnibot_driver.simulator.fejemis.vehicle import Vehicle

GRAVITY_MPS2 = 9.80665
EARTH_UT = (17.0, 0.0, -47.0)
"""Magnetic field of the earth in µT. North is along x, and the field points mostly down."""
CALIBRATION_S = 1.0


class Imu:
    """The simulated IMU.

    ``orientation``: roll, pitch and yaw in rad.

    ``calibrated``: new offsets if a calibration has just ended, otherwise None.
    """

    def __init__(self, settings: FejemisSettings, vehicle: Vehicle) -> None:
        self._settings, self._vehicle = settings, vehicle
        self._random = Random(f"fejemis imu {settings.seed}")
        self.orientation = (0.0, 0.0, 0.0)
        self.calibrated: dict[str, Any] | None = None
        self._kind, self._left_s = "", 0.0
        self._samples: list[Vector] = []

    def boot(self) -> None:
        """Reset the orientation, and cancel a calibration that is in progress."""
        self.orientation = (0.0, 0.0, 0.0)
        self._kind, self._samples = "", []

    def cycle(self, step_s: float, config: DriveConfig) -> None:
        """Integrate the yaw over one step, and continue a calibration that is in progress."""
        truth = self._vehicle.truth
        bias_dps = self._settings.gyro_bias_dps[2] - config.gyro_offset_dps[2]
        roll, pitch, yaw = self.orientation
        yaw += (truth.yaw_rate_radps + radians(bias_dps)) * step_s
        self.orientation = (roll, pitch, (yaw + pi) % (2 * pi) - pi)
        if self._kind:
            self._calibrate(step_s)

    def calibrate_gyro(self) -> None:
        """Begin to average the gyro for 1 s. If the robot turns meanwhile, the offset is wrong."""
        self._kind, self._left_s, self._samples = "gyro", CALIBRATION_S, []

    def calibrate_accelerometer(self) -> None:
        """Begin to average the accelerometer for 1 s. The board is assumed to be level."""
        self._kind, self._left_s, self._samples = "accel", CALIBRATION_S, []

    def _calibrate(self, step_s: float) -> None:
        self._samples.append(self._raw_gyro() if self._kind == "gyro" else self._raw_accel())
        self._left_s -= step_s
        if self._left_s > 1e-9:
            return
        x, y, z = (sum(axis) / len(self._samples) for axis in zip(*self._samples, strict=True))
        if self._kind == "gyro":
            self.calibrated = {"gyro_offset_dps": (x, y, z)}
        else:
            self.calibrated = {"accel_offset_mps2": (x, y, z - GRAVITY_MPS2)}
        self._kind = ""

    def gyro(self, config: DriveConfig) -> Iterator[float]:
        """Return the turn rates in degrees per second, minus the configured offsets."""
        return _minus(self._raw_gyro(), config.gyro_offset_dps)

    def accel(self, config: DriveConfig) -> Iterator[float]:
        """Return the specific force in m/s², with the configured offsets and scales applied."""
        raw, offset = self._raw_accel(), config.accel_offset_mps2
        return (
            (axis - off) * scale
            for axis, off, scale in zip(raw, offset, config.accel_scale, strict=True)
        )

    def mag_raw(self) -> Vector:
        """Return the magnetic field in µT in the axes of the board, without calibration."""
        yaw = self._vehicle.truth.yaw_rad
        north, _, up = EARTH_UT
        return (north * cos(yaw), -north * sin(yaw), up)

    def mag(self, config: DriveConfig) -> Iterator[float]:
        """Return the magnetic field in µT, with the configured offsets and matrix applied."""
        shifted = list(_minus(self.mag_raw(), config.mag_offset_ut))
        rows = [config.mag_matrix[at : at + 3] for at in (0, 3, 6)]
        return (sum(a * b for a, b in zip(row, shifted, strict=True)) for row in rows)

    def _raw_gyro(self) -> Vector:
        bias, noise = self._settings.gyro_bias_dps, self._settings.gyro_noise_dps
        gauss = self._random.gauss
        return (
            bias[0] + gauss(0.0, noise),
            bias[1] + gauss(0.0, noise),
            bias[2] + gauss(0.0, noise) + degrees(self._vehicle.truth.yaw_rate_radps),
        )

    def _raw_accel(self) -> Vector:
        bias, noise = self._settings.accel_bias_mps2, self._settings.accel_noise_mps2
        forward, left = self._vehicle.accel_mps2
        gauss = self._random.gauss
        return (
            bias[0] + gauss(0.0, noise) + forward,
            bias[1] + gauss(0.0, noise) + left,
            bias[2] + gauss(0.0, noise) + GRAVITY_MPS2,
        )


def _minus(one: Vector, other: Vector) -> Iterator[float]:
    return (a - b for a, b in zip(one, other, strict=True))
