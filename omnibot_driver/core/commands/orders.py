# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Motion orders to a board, in SI units and the board's own axes: values without behaviour.

An order has passed every check and limit.
"""

from typing import Final

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.values import value


@value(frozen=True, slots=True)
class Stop:
    """The order to stand still."""


@value(frozen=True, slots=True)
class EmergencyStop:
    """The order to stand still, with the board's own emergency stop as well, if it has one."""


@value(frozen=True, slots=True)
class Drive:
    """The order to move with the body velocity ``twist``."""

    twist: BodyTwist


@value(frozen=True, slots=True)
class TurnWheels:
    """The order to turn the wheels at rates in rad/s, in the sequence of ``Traits.wheels``."""

    rates_radps: tuple[float, ...]


@value(frozen=True, slots=True)
class GoTo:
    """The order to drive to the pose ``place`` in the board's earth frame, and stay there."""

    place: Pose


Order = Stop | EmergencyStop | Drive | TurnWheels | GoTo

STOP: Final = Stop()
EMERGENCY_STOP: Final = EmergencyStop()
