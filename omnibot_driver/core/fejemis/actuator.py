# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Sends the motion lines (``rc``) to both boards, and repeats them.

The lines are also repeated after each new angle of the front wheel, if this angle limits the speed
or if the lines have no checksum.
"""

import math
from typing import Protocol

from omnibot_driver.core.commands.actuator import Wanted
from omnibot_driver.core.commands.orders import EmergencyStop, Stop
from omnibot_driver.core.commands.set_point_stream import SetpointStream
from omnibot_driver.core.commands.stop_proof import StopProof
from omnibot_driver.core.fejemis.encoder import Encoder


class Listener(Protocol):
    """An object that is notified of each new order."""

    def wanted(self, *, estop: bool) -> None:
        """Receive the notification of a new order.

        ``estop``: whether the order is an emergency stop.
        """


class PairStream(SetpointStream):
    """Stream that sends the set-point to both boards, and repeats it.

    ``driving``: whether the set-point is a motion, not a stop.
    """

    def __init__(self, encoder: Encoder, proof: StopProof, listener: Listener) -> None:
        self.driving = False
        self._pair, self._listener = encoder, listener
        super().__init__(encoder, proof)

    def connect(self) -> None:
        """Begin a new connection, on which no motion is commanded yet."""
        self.driving = False
        super().connect()

    def apply(self, wanted: Wanted, now: float) -> None:
        """Replace the set-point, and notify the listener of the new order."""
        is_stop = wanted is None or isinstance(wanted, Stop | EmergencyStop)
        self.driving = not is_stop and not wanted.is_zero  # type: ignore[union-attr]
        self._listener.wanted(estop=isinstance(wanted, EmergencyStop))
        if not self.driving:
            self._pair.begin()
        super().apply(wanted, now)

    def angle_told(self, angle_rad: float, now: float) -> bool:
        """Receive the front wheel's angle in rad; return whether it shows a new fault of the wheel.

        A faulty wheel does not follow its commanded angle.
        """
        if self.driving and self._pair.restless:
            self._said_at = -math.inf
        return self._pair.follower.look(angle_rad, now)
