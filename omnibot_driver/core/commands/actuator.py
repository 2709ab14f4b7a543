# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The interface between the command policy and a board's encoding of motion.

An actuator turns orders into packets, and may repeat them. It refuses no order of the policy.
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
        """Body velocity of the last sent command, as the board rounds it, in the board's axes.

        None after a command that determines no velocity, such as a goal.
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
