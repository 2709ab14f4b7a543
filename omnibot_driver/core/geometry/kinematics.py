# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Three omni wheels and the body they carry; no time, no noise, no bytes.

Axes are REP-103's: x forward, y left, yaw counter-clockwise. Source: the velocity equations and the
odometry matrix of the manual's "Control equation" and "Odometry equation", without the firmware's
command-path gains. The same equations turn small displacements into wheel angles and back.
"""

import math
from dataclasses import dataclass
from typing import Final

from omnibot_driver.core.values import value

COS30: Final = math.cos(math.radians(30))
SIN30: Final = math.sin(math.radians(30))


@value(frozen=True, slots=True)
class BodyTwist:
    """Velocity of the body in its own frame: m/s forward, m/s to the left, rad/s to the left."""

    vx_mps: float
    vy_mps: float
    yaw_rate_radps: float

    def faster_than(self, linear_mps: float, angular_radps: float) -> bool:
        """Whether it moves or turns faster than this."""
        return (
            math.hypot(self.vx_mps, self.vy_mps) > linear_mps
            or abs(self.yaw_rate_radps) > angular_radps
        )


@dataclass(frozen=True, slots=True)
class OmniKinematics:
    """Wheels A, B, C of radius ``wheel_radius_m`` on a circle of radius ``base_radius_m``."""

    wheel_radius_m: float
    base_radius_m: float

    def wheel_rates(self, twist: BodyTwist) -> tuple[float, float, float]:
        """Rates of A, B, C in rad/s that move the body with this twist."""
        along_x = COS30 * twist.vx_mps
        along_y = SIN30 * twist.vy_mps
        turning = self.base_radius_m * twist.yaw_rate_radps
        return (
            (-along_x - along_y - turning) / self.wheel_radius_m,
            (along_x - along_y - turning) / self.wheel_radius_m,
            (twist.vy_mps - turning) / self.wheel_radius_m,
        )

    def body_twist(self, wheel_rates: tuple[float, float, float]) -> BodyTwist:
        """Twist of the body whose wheels A, B, C turn without slip at these rates in rad/s."""
        a, b, c = (rate * self.wheel_radius_m for rate in wheel_rates)
        return BodyTwist(
            vx_mps=(b - a) / (2 * COS30),
            vy_mps=(2 * c - a - b) / 3,
            yaw_rate_radps=-(a + b + c) / (3 * self.base_radius_m),
        )
