# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Kinematics of a body on three omni wheels.

Source: the manual's "Control equation" and "Odometry equation", without the firmware's command
gains.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Final

from omnibot_driver.core.geometry.twist import BodyTwist

COS30: Final = math.cos(math.radians(30))
SIN30: Final = math.sin(math.radians(30))


@dataclass(frozen=True, slots=True)
class OmniKinematics:
    """Wheels A, B, C of radius ``wheel_radius_m`` on a circle of radius ``base_radius_m``."""

    wheel_radius_m: float
    base_radius_m: float

    joints: ClassVar = ("wheel_a_joint", "wheel_b_joint", "wheel_c_joint")

    @property
    def rims(self) -> "OmniKinematics":
        """The same kinematics with wheels of 1 m radius. Its wheel rates are rim speeds in m/s."""
        return replace(self, wheel_radius_m=1.0)

    def feasible(self, twist: BodyTwist) -> BodyTwist:
        """Return ``twist`` unchanged: three omni wheels can produce every twist in the plane."""
        return twist

    def wheel_rates(self, twist: BodyTwist) -> tuple[float, float, float]:
        """Return the rates of A, B, C in rad/s that move the body with this twist."""
        along_x = COS30 * twist.vx_mps
        along_y = SIN30 * twist.vy_mps
        turning = self.base_radius_m * twist.yaw_rate_radps
        return (
            (-along_x - along_y - turning) / self.wheel_radius_m,
            (along_x - along_y - turning) / self.wheel_radius_m,
            (twist.vy_mps - turning) / self.wheel_radius_m,
        )

    def body_twist(self, wheel_rates: Sequence[float]) -> BodyTwist:
        """Return the twist of the body whose wheels turn without slip at these rates in rad/s."""
        a, b, c = (rate * self.wheel_radius_m for rate in wheel_rates)
        return BodyTwist(
            vx_mps=(b - a) / (2 * COS30),
            vy_mps=(2 * c - a - b) / 3,
            yaw_rate_radps=-(a + b + c) / (3 * self.base_radius_m),
        )
