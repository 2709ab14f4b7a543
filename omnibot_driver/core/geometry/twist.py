# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Velocity of a body in the plane."""

import math

from omnibot_driver.core.values import value


@value(frozen=True, slots=True)
class BodyTwist:
    """Velocity of the body in its own axes: forward and left in m/s, yaw rate in rad/s."""

    vx_mps: float
    vy_mps: float
    yaw_rate_radps: float

    def faster_than(self, linear_mps: float, angular_radps: float) -> bool:
        """Return whether the linear or the angular speed exceeds its limit."""
        return (
            math.hypot(self.vx_mps, self.vy_mps) > linear_mps
            or abs(self.yaw_rate_radps) > angular_radps
        )
