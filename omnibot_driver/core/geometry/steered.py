# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Kinematics of a body with two driven wheels on one axle and a steered wheel ahead of it.

The origin of the body's frame is the middle of the driven axle.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

from omnibot_driver.core.geometry.differential import DifferentialKinematics
from omnibot_driver.core.geometry.twist import BodyTwist


@dataclass(frozen=True, slots=True)
class SteeredKinematics:
    """Two driven wheels on one axle, and a steered wheel ``wheelbase_m`` ahead of the axle."""

    wheel_radius_m: float
    track_m: float
    wheelbase_m: float

    joints: ClassVar = DifferentialKinematics.joints
    steering_joint: ClassVar = "front_steering_joint"

    @property
    def rims(self) -> "SteeredKinematics":
        """The same kinematics with wheels of 1 m radius. Its wheel rates are rim speeds in m/s."""
        return replace(self, wheel_radius_m=1.0)

    def feasible(self, twist: BodyTwist) -> BodyTwist:
        """Return the twist without its sideways part."""
        return self._axle.feasible(twist)

    def wheel_rates(self, twist: BodyTwist) -> tuple[float, float]:
        """Return the rates of the left and the right wheel, in rad/s."""
        return self._axle.wheel_rates(twist)

    def body_twist(self, wheel_rates: Sequence[float]) -> BodyTwist:
        """Return the twist of the body whose driven wheels turn at these rates, in rad/s."""
        return self._axle.body_twist(wheel_rates)

    def steering_rad(self, twist: BodyTwist) -> float:
        """Return the steered wheel's angle in rad, from -pi/2 to pi/2; 0 at rest.

        A positive angle is to the left, for example pi/2 for a left turn on the spot.
        """
        speed, sideways = twist.vx_mps, self.wheelbase_m * twist.yaw_rate_radps
        if speed < 0.0:
            speed, sideways = -speed, -sideways
        return math.atan2(sideways, speed)

    def steered_twist(self, speed_mps: float, steering_rad: float) -> BodyTwist:
        """Return the twist of the body whose steered wheel rolls at this speed, at this angle."""
        return BodyTwist(
            speed_mps * math.cos(steering_rad),
            0.0,
            speed_mps * math.sin(steering_rad) / self.wheelbase_m,
        )

    @property
    def _axle(self) -> DifferentialKinematics:
        return DifferentialKinematics(self.wheel_radius_m, self.track_m)
