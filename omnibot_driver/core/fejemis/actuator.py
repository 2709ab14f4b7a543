# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The set-point stream for both boards, which repeats the motion lines.

While ``Encoder`` limits the drive board's speed, each new angle of the front wheel may allow more
speed. So, while the speed is limited, the stream sends the motion lines with each new angle, and
not only at the repetition rate. The module decides when a line is due, not what the line contains.
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
        """Take note of a new order; ``estop``: whether the order is an emergency stop."""


class PairStream(SetpointStream):
    """The set-point stream of both boards; ``driving``: whether a motion is commanded."""

    def __init__(self, encoder: Encoder, proof: StopProof, listener: Listener) -> None:
        self.driving = False
        self._pair, self._listener = encoder, listener
        super().__init__(encoder, proof)

    def connect(self) -> None:
        """Begin a new connection; no motion is commanded yet."""
        self.driving = False
        super().connect()

    def apply(self, wanted: Wanted, now: float) -> None:
        """Replace the set-point; notify the listener whether the order is an emergency stop."""
        is_stop = wanted is None or isinstance(wanted, Stop | EmergencyStop)
        self.driving = not is_stop and not wanted.is_zero  # type: ignore[union-attr]
        self._listener.wanted(estop=isinstance(wanted, EmergencyStop))
        if not self.driving:
            self._pair.begin()
        super().apply(wanted, now)

    def angle_told(self, angle_rad: float, now: float) -> bool:
        """Take the front angle, in rad; return True if a new fault of the front wheel is found.

        The fault is that the wheel does not follow its commanded angle.
        """
        if self.driving and self._pair.restless:
            self._said_at = -math.inf
        return self._pair.follower.look(angle_rad, now)
