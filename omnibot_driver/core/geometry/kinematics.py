# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What any arrangement of wheels tells the rest of the driver.

Axes are REP-103's: x forward, y left, yaw counter-clockwise. Rates are of the wheels that are
driven, in rad/s, in the order of ``joints``. The same equations turn small displacements into wheel
angles and back. No time, no noise, no bytes.
"""

from collections.abc import Sequence
from typing import Protocol

from omnibot_driver.core.geometry.twist import BodyTwist


class Kinematics(Protocol):
    """Wheels under a body, none of which slips; a frozen value."""

    def __hash__(self) -> int:
        """Kinematics are hashable, so that derived values can be cached."""

    @property
    def rims(self) -> "Kinematics":
        """The same with wheels of 1 m, so that rates are speeds of the rims."""

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the driven wheels' joints, as in the robot's description."""

    def feasible(self, twist: BodyTwist) -> BodyTwist:
        """The part of this twist that the wheels can make."""

    def wheel_rates(self, twist: BodyTwist) -> tuple[float, ...]:
        """Rates that move the body with the feasible part of this twist."""

    def body_twist(self, wheel_rates: Sequence[float]) -> BodyTwist:
        """Twist of the body whose wheels turn at these rates."""
