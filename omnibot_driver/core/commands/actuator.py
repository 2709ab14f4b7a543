# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""How a board is made to carry out what is wanted: the seam between policy and bytes.

The policy decides what is wanted and for how long. An actuator says it: as set-points that are
repeated (`set_point_stream.py`), or as a conversation of the board's own. It tells the stop proof
what went out. It reads no clock and never refuses what the policy wants.
"""

from typing import Protocol

from omnibot_driver.core.commands.orders import EmergencyStop, Order, Stop
from omnibot_driver.core.commands.set_points import Setpoint
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.packets import Packets

Wanted = Setpoint | Stop | EmergencyStop | None
"""What the robot is to do; None: the line is quiet."""


class Actuator(Protocol):
    """``rate_hz``: how often a set-point is repeated, where the board needs that."""

    rate_hz: float

    @property
    def commanded(self) -> BodyTwist | None:
        """The body velocity that was said last, in the board's axes, as rounded there.

        None where any motion is possible.
        """

    @property
    def wake_at(self) -> float:
        """The time at which ``due`` must be called again; infinity while nothing is due."""

    def is_zero(self, order: Order) -> bool:
        """Whether the command is a standstill for the board.

        Raises CommandRefused if it cannot be encoded.
        """

    def connect(self) -> None:
        """Begin a new connection, on which nothing has been sent and nothing is wanted."""

    def apply(self, wanted: Wanted, now: float) -> None:
        """Carry out this order from now on."""

    def wrote(self, packets: Packets, now: float) -> None:
        """Note that a request to the board was sent."""

    def due(self, now: float) -> Packets:
        """The packets to write now, possibly none. They count as written."""
