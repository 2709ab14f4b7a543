# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Conversion of an MPU6050's counts into SI units, in the sensor's axes, and a check with gravity.

Source: MPU-6050 product specification, 6.1 and 6.2.
"""

import math
from dataclasses import dataclass
from typing import Final

from omnibot_driver.core.readings import Vector3

STANDARD_GRAVITY: Final = 9.80665

ACCEL_COUNTS_PER_G: Final = {2: 16384.0, 4: 8192.0, 8: 4096.0, 16: 2048.0}
"""Counts per g, by full-scale range in g."""
GYRO_COUNTS_PER_DPS: Final = {250: 131.0, 500: 65.5, 1000: 32.8, 2000: 16.4}
"""Counts per degree per second, by full-scale range in degrees per second."""
_MPS2_PER_COUNT: Final = {g: STANDARD_GRAVITY / counts for g, counts in ACCEL_COUNTS_PER_G.items()}
_RADPS_PER_COUNT: Final = {
    dps: math.radians(1.0 / counts) for dps, counts in GYRO_COUNTS_PER_DPS.items()
}

ACCEL_TOLERANCE: Final = 0.1
"""Largest accepted relative error of the measured gravity. The sensor's tolerance and bias can
cause such an error."""

Counts = tuple[int, int, int]


def gravity_advice(gravity_mps2: float, accel_range_g: int) -> str:
    """Return advice on the settings if the measured gravity is wrong; otherwise empty."""
    if abs(gravity_mps2 / STANDARD_GRAVITY - 1.0) <= ACCEL_TOLERANCE:
        return ""
    wrong = f"at rest the accelerometer measures {gravity_mps2:.2f} m/s² instead of gravity: "
    for range_g in ACCEL_COUNTS_PER_G:
        meant = gravity_mps2 * range_g / accel_range_g
        if abs(meant / STANDARD_GRAVITY - 1.0) <= ACCEL_TOLERANCE:
            return wrong + f"set `accel_range` to {range_g}"
    return wrong + "check `accel_range` and `accel_bias`, or the sensor"


@dataclass(frozen=True, slots=True, kw_only=True)
class ImuScale:
    """The conversion for one range of the accelerometer and one of the gyro.

    Possible ranges: 2, 4, 8 or 16 g, and 250, 500, 1000 or 2000 degrees per second.
    """

    accel_range_g: int = 2
    gyro_range_dps: int = 250

    def specific_force(self, counts: Counts) -> Vector3:
        """Convert counts to m/s²."""
        unit = _MPS2_PER_COUNT[self.accel_range_g]
        x, y, z = counts
        return x * unit, y * unit, z * unit

    def angular_velocity(self, counts: Counts) -> Vector3:
        """Convert counts to rad/s."""
        unit = _RADPS_PER_COUNT[self.gyro_range_dps]
        u, v, w = counts
        return u * unit, v * unit, w * unit
