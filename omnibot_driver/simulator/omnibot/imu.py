# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The IMU, an MPU6050 with the ranges ±2 g and ±250 °/s. By default the IMU is mounted upside down.

Its distance from the body's origin is ignored.

This module knows the sensor's scales, axes, bias and noise. It must not know the frame layout.
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


def _counts(value: float) -> int:
    return max(-32768, min(32767, round(value)))


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
        gauss, settings, held = self._random.gauss, self._settings, world.held
        ax_mps2, ay_mps2 = world.acceleration
        level = cos(held.pitch_rad)
        up = (-sin(held.pitch_rad), level * sin(held.roll_rad), level * cos(held.roll_rad))
        force_g = self._seen(
            up[0] + ax_mps2 / STANDARD_GRAVITY_MPS2, up[1] + ay_mps2 / STANDARD_GRAVITY_MPS2, up[2]
        )
        rates_dps = self._seen(0.0, 0.0, degrees(world.truth.yaw_rate + held.yaw_rate))
        ax, ay, az = (
            _counts((g + bias + gauss(0.0, settings.accel_noise_g)) * COUNTS_PER_G)
            for g, bias in zip(force_g, settings.accel_bias_g, strict=True)
        )
        if settings.gyro_walk_dps:
            self._wander()
        gx, gy, gz = (
            _counts((rate + bias + gauss(0.0, settings.gyro_noise_dps)) * COUNTS_PER_DPS)
            for rate, bias in zip(rates_dps, self._bias_dps, strict=True)
        )
        return (ax, ay, az), settings.gyro_stuck or (gx, gy, gz)

    def _seen(self, x: float, y: float, z: float) -> tuple[float, float, float]:
        """Convert a vector from the body's axes to the sensor's axes."""
        along_x, along_y, along_z = (
            axis[0] * x + axis[1] * y + axis[2] * z for axis in self._sensor_axes
        )
        return along_x, along_y, along_z

    def _wander(self) -> None:
        step_dps = self._settings.gyro_walk_dps * sqrt(TICK_S)
        x, y, z = (bias + self._wandering.gauss(0.0, step_dps) for bias in self._bias_dps)
        self._bias_dps = x, y, z


def _axes(roll: float, pitch: float, yaw: float) -> tuple[tuple[float, float, float], ...]:
    """Return the sensor's axes in body coordinates.

    ``roll``, ``pitch``, ``yaw``: turns about fixed axes, in rad, in this order.
    """
    sr, cr, sp, cp, sy, cy = sin(roll), cos(roll), sin(pitch), cos(pitch), sin(yaw), cos(yaw)
    return (
        (cy * cp, sy * cp, -sp),
        (cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr),
        (cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr),
    )
