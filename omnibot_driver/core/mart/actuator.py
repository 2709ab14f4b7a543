# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The actuator of the MART controller: it passes commands to the ``Pilot``.

This module knows which commands the controller cannot carry out; it does not know which requests
the ``Pilot`` sends to the server. The caller passes the time.
"""

from typing import Final

from omnibot_driver.core.commands.actuator import Wanted
from omnibot_driver.core.commands.orders import Drive, GoTo, Order
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.mart.pilot import Pilot
from omnibot_driver.core.mart.required_motion import SLOWEST_MPS, SLOWEST_RADPS
from omnibot_driver.core.packets import Packets

FARTHEST_M: Final = 1000.0
"""Largest distance to a goal, in m. The server might misread the digits of a larger distance."""


class Conductor:
    """The actuator: it passes commands to ``pilot``, which sends one request at a time."""

    rate_hz = 20.0

    def __init__(self, pilot: Pilot) -> None:
        self._pilot = pilot

    @property
    def commanded(self) -> BodyTwist | None:
        """The body velocity of the last motor command, or None in a controlled move.

        The server itself chooses the velocity of a controlled move.
        """
        return self._pilot.commanded

    @property
    def wake_at(self) -> float:
        """The time at which ``due`` must be called again."""
        return self._pilot.wake_at

    def is_zero(self, order: Order) -> bool:
        """Return whether the order is so slow that the driver regards it as a standstill.

        A goal (GoTo) is never a standstill. Raises CommandRefused if the goal is more than
        FARTHEST_M (m) away from the robot.
        """
        if isinstance(order, GoTo):
            way_m = self._pilot.odometry.pose.way_to(order.place).way_m
            if not way_m <= FARTHEST_M:
                raise CommandRefused(
                    f"cmd_pose rejected: the goal is {way_m:g} m away, but the limit is"
                    f" {FARTHEST_M:g} m; choose a nearer goal"
                )
            return False
        return not isinstance(order, Drive) or not (
            abs(order.twist.vx_mps) >= SLOWEST_MPS
            or abs(order.twist.yaw_rate_radps) >= SLOWEST_RADPS
        )

    def connect(self) -> None:
        """Do nothing, because ``MartBoard.connect`` has already reset the ``Pilot``."""

    def apply(self, wanted: Wanted, now: float) -> None:
        """Carry out ``wanted`` from now on, instead of the previous command."""
        self._pilot.apply(wanted, now)

    def wrote(self, packets: Packets, now: float) -> None:
        """Do nothing, because the ``Pilot`` already repeats ``packets`` until the server answers.

        They are the packets that ``MartBoard.wake`` returns.
        """

    def due(self, now: float) -> Packets:
        """Return the packets to write now."""
        return self._pilot.due(now)
