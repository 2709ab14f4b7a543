# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The interface between the command policy and a board's encoding of motion.

The command policy decides what the robot should do; an actuator makes the packets for it. On some
boards, the actuator sends each set-point repeatedly (`set_point_stream.py`). An actuator reads no
clock, and never refuses what the command policy orders.
"""

from typing import Protocol

from omnibot_driver.core.commands.orders import EmergencyStop, Order, Stop
from omnibot_driver.core.commands.set_points import Setpoint
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.packets import Packets

Wanted = Setpoint | Stop | EmergencyStop | None
"""What the robot should do. None means: send nothing."""


class Actuator(Protocol):
    """The part of a board that carries out motion orders.

    ``rate_hz``: rate at which a set-point is repeated, if the board needs repetition.
    """

    rate_hz: float

    @property
    def commanded(self) -> BodyTwist | None:
        """Body velocity of the last command that was sent, in the board's axes.

        It is the velocity after the board's encoding has rounded it. None after a command that
        determines no velocity, such as a goal.
        """

    @property
    def wake_at(self) -> float:
        """Time at which ``due`` must be called again, in s; infinity if nothing is due."""

    def is_zero(self, order: Order) -> bool:
        """Return whether this order makes the robot stand still.

        Raises CommandRefused if the order cannot be encoded.
        """

    def connect(self) -> None:
        """Begin a new connection, on which nothing was sent and no order is in effect."""

    def apply(self, wanted: Wanted, now: float) -> None:
        """Send ``wanted`` from now on, in place of the previous order."""

    def wrote(self, packets: Packets, now: float) -> None:
        """Record that packets of a request (e.g. a start) were sent. They command no motion."""

    def due(self, now: float) -> Packets:
        """Return the packets to write now, possibly none. From then on, they count as written."""
