# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The IMU, an MPU6050 with the ranges ±2 g and ±250 °/s, by default mounted upside down.

The position of the IMU on the robot is ignored. This module must not know the frame layout.
"""

from math import cos, degrees, sin, sqrt
from random import Random

from omnibot_driver.simulator.omnibot.motors import TICK_S
from omnibot_driver.simulator.omnibot.settings import BoardSettings
from omnibot_driver.simulator.omnibot.wire import Triple
from omnibot_driver.simulator.omnibot.world import World

STANDARD_GRAVITY_MPS2 = 9.80665
COUNTS_PER_G = 16384.0
COUNTS_PER_DPS = 131.0

Vector = tuple[float, float, float]


def _counts(value: float) -> int:
    counts = round(value)
    return counts if -32768 <= counts <= 32767 else max(-32768, min(32767, counts))


class Mpu6050:
    """The IMU: converts true motion to raw counts."""

    def __init__(self, settings: BoardSettings) -> None:
        self._settings = settings
        self._random = Random(f"imu {settings.seed}")
        self._sensor_axes = _axes(*settings.imu_rpy_rad)
        self._wandering = Random(f"gyro bias {settings.seed}")
        self._bias_dps = settings.gyro_bias_dps

    def read(self, world: World) -> tuple[Triple, Triple]:
        """Return accelerometer and gyro readings, in raw counts along the sensor's axes."""
        settings, (roll_rad, pitch_rad, held_yaw_rate) = self._settings, world.held
        ax_mps2, ay_mps2 = world.acceleration
        level = cos(pitch_rad)
        force_g = self._seen(
            -sin(pitch_rad) + ax_mps2 / STANDARD_GRAVITY_MPS2,
            level * sin(roll_rad) + ay_mps2 / STANDARD_GRAVITY_MPS2,
            level * cos(roll_rad),
        )
        accel = self._measured(force_g, settings.accel_bias_g, settings.accel_noise_g, COUNTS_PER_G)
        if settings.gyro_walk_dps:
            self._wander()
        rates_dps = self._seen(0.0, 0.0, degrees(world.yaw_rate + held_yaw_rate))
        gyro = self._measured(rates_dps, self._bias_dps, settings.gyro_noise_dps, COUNTS_PER_DPS)
        return accel, settings.gyro_stuck or gyro

    def _seen(self, x: float, y: float, z: float) -> Vector:
        """Convert a vector from the body's axes to the sensor's axes."""
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = self._sensor_axes
        return xx * x + xy * y + xz * z, yx * x + yy * y + yz * z, zx * x + zy * y + zz * z

    def _measured(self, true: Vector, bias: Vector, rms: float, counts_per_unit: float) -> Triple:
        """Return the counts for a true vector in the sensor's axes, with bias and noise."""
        (x, y, z), (bias_x, bias_y, bias_z), gauss = true, bias, self._random.gauss
        return (
            _counts((x + bias_x + gauss(0.0, rms)) * counts_per_unit),
            _counts((y + bias_y + gauss(0.0, rms)) * counts_per_unit),
            _counts((z + bias_z + gauss(0.0, rms)) * counts_per_unit),
        )

    def _wander(self) -> None:
        step_dps = self._settings.gyro_walk_dps * sqrt(TICK_S)
        x, y, z = (bias + self._wandering.gauss(0.0, step_dps) for bias in self._bias_dps)
        self._bias_dps = x, y, z


def _axes(roll: float, pitch: float, yaw: float) -> tuple[Vector, Vector, Vector]:
    """Return the sensor's axes in body coordinates.

    ``roll``, ``pitch``, ``yaw``: turns about fixed axes, in rad, in this order.
    """
    sr, cr, sp, cp, sy, cy = sin(roll), cos(roll), sin(pitch), cos(pitch), sin(yaw), cos(yaw)
    return (
        (cy * cp, sy * cp, -sp),
        (cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr),
        (cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr),
    )
