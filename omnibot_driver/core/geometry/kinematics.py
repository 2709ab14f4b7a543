# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The interface that every arrangement of wheels offers to the driver.

Axes are REP-103's. Wheel rates are in rad/s, in the order of ``joints``. The methods also convert
small displacements of the body into rotations of the wheels, and back.
"""

from collections.abc import Sequence
from typing import Protocol

from omnibot_driver.core.geometry.twist import BodyTwist


class Kinematics(Protocol):
    """Kinematics of a body on wheels that do not slip. Objects are immutable."""

    def __hash__(self) -> int:
        """Return a hash, so that values derived from the kinematics can be cached."""

    @property
    def rims(self) -> "Kinematics":
        """The same geometry with wheels of 1 m radius, so wheel rates are rim speeds in m/s."""

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the driven wheels' joints, as in the robot's description."""

    def feasible(self, twist: BodyTwist) -> BodyTwist:
        """Return the part of this twist that the wheels can produce without slip."""

    def wheel_rates(self, twist: BodyTwist) -> tuple[float, ...]:
        """Return the wheel rates in rad/s that produce the feasible part of this twist."""

    def body_twist(self, wheel_rates: Sequence[float]) -> BodyTwist:
        """Return the twist of the body whose wheels turn at these rates, in rad/s."""
