"""The MPU6050 as it is mounted: upside down under the robot, +-2 g and +-250 degrees per second.

Knows the sensor's scales, axes, bias and noise. Must not know the wire. The lever arm between the
sensor and the body's origin is ignored (at 0.5 rad/s it would add less than 0.01 m/s²).
"""

from math import cos, degrees, radians, sin, sqrt
from random import Random

from omnibot_driver.simulator.motors import TICK_S
from omnibot_driver.simulator.settings import BoardSettings
from omnibot_driver.simulator.wire import Triple
from omnibot_driver.simulator.world import World

STANDARD_GRAVITY_MPS2 = 9.80665
COUNTS_PER_G = 16384.0
COUNTS_PER_DPS = 131.0


def _counts(value: float) -> int:
    return max(-32768, min(32767, round(value)))


class Mpu6050:
    """Turns true motion into raw counts."""

    def __init__(self, settings: BoardSettings) -> None:
        self._settings = settings
        self._random = Random(f"imu {settings.seed}")
        self._wandering = Random(f"gyro bias {settings.seed}")
        self._bias_dps = settings.gyro_bias_dps

    def read(self, world: World) -> tuple[Triple, Triple]:
        """Sample the accelerometer and the gyro, in raw counts along the sensor's axes.

        Rolled by half a turn, the sensor keeps the body's x and sees its y and z reversed.
        """
        gauss, settings = self._random.gauss, self._settings
        ax_mps2, ay_mps2 = world.acceleration
        forces_g = self._askew(
            (ax_mps2 / STANDARD_GRAVITY_MPS2, -ay_mps2 / STANDARD_GRAVITY_MPS2, -1.0)
        )
        ax, ay, az = (
            _counts((g + bias + gauss(0.0, settings.accel_noise_g)) * COUNTS_PER_G)
            for g, bias in zip(forces_g, settings.accel_bias_g, strict=True)
        )
        if settings.gyro_walk_dps:
            self._wander()
        rates_dps = self._askew((0.0, 0.0, -degrees(world.truth.yaw_rate)))
        gx, gy, gz = (
            _counts((rate + bias + gauss(0.0, settings.gyro_noise_dps)) * COUNTS_PER_DPS)
            for rate, bias in zip(rates_dps, self._bias_dps, strict=True)
        )
        return (ax, ay, az), settings.gyro_stuck or (gx, gy, gz)

    def _wander(self) -> None:
        step_dps = self._settings.gyro_walk_dps * sqrt(TICK_S)
        x, y, z = (bias + self._wandering.gauss(0.0, step_dps) for bias in self._bias_dps)
        self._bias_dps = x, y, z

    def _askew(self, vector: tuple[float, float, float]) -> tuple[float, float, float]:
        """A vector along the axes of a straight sensor, along those of the tilted one."""
        roll, pitch = map(radians, self._settings.imu_tilt_deg)
        x, y, z = vector
        x, z = cos(pitch) * x + sin(pitch) * z, cos(pitch) * z - sin(pitch) * x
        return x, cos(roll) * y + sin(roll) * z, cos(roll) * z - sin(roll) * y
