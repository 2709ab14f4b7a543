# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Kinematics of a body with two driven wheels on one axle.

The origin of the body's frame is the middle of the axle.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

from omnibot_driver.core.geometry.twist import BodyTwist


@dataclass(frozen=True, slots=True)
class DifferentialKinematics:
    """Two wheels of radius ``wheel_radius_m``, ``track_m`` apart. Positive rates drive forward."""

    wheel_radius_m: float
    track_m: float

    joints: ClassVar = ("left_wheel_joint", "right_wheel_joint")

    @property
    def rims(self) -> "DifferentialKinematics":
        """The same robot with wheels of 1 m radius. Its wheel rates equal the rim speeds in m/s."""
        return replace(self, wheel_radius_m=1.0)

    def feasible(self, twist: BodyTwist) -> BodyTwist:
        """Return the twist without its sideways part."""
        return BodyTwist(twist.vx_mps, 0.0, twist.yaw_rate_radps)

    def wheel_rates(self, twist: BodyTwist) -> tuple[float, float]:
        """Return the rates of the left and the right wheel, in rad/s."""
        turning = twist.yaw_rate_radps * self.track_m / 2
        return (
            (twist.vx_mps - turning) / self.wheel_radius_m,
            (twist.vx_mps + turning) / self.wheel_radius_m,
        )

    def body_twist(self, wheel_rates: Sequence[float]) -> BodyTwist:
        """Return the twist of the body whose left and right wheel turn at these rates in rad/s."""
        left, right = (rate * self.wheel_radius_m for rate in wheel_rates)
        return BodyTwist((left + right) / 2, 0.0, (right - left) / self.track_m)
