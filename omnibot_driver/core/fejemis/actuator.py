# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Set-points for both boards at once: repeated, and said again as the front wheel turns.

While the encoder holds the drive board back, each new angle may allow it more speed; so the lines
are sent again with each angle, not only at the rate of repetition. Knows when a line is due;
not what is in it.
"""

import math
from typing import Protocol

from omnibot_driver.core.commands.actuator import Wanted
from omnibot_driver.core.commands.orders import EmergencyStop, Stop
from omnibot_driver.core.commands.set_point_stream import SetpointStream
from omnibot_driver.core.commands.stop_proof import StopProof
from omnibot_driver.core.fejemis.encoder import Encoder


class Listener(Protocol):
    """Who has to know of an emergency stop."""

    def wanted(self, *, estop: bool) -> None:
        """Whether what is wanted from now on is an emergency stop."""


class PairStream(SetpointStream):
    """``driving``: whether a motion is wanted."""

    def __init__(self, encoder: Encoder, proof: StopProof, listener: Listener) -> None:
        self.driving = False
        self._pair, self._listener = encoder, listener
        super().__init__(encoder, proof)

    def connect(self) -> None:
        """Nothing has been said."""
        self.driving = False
        super().connect()

    def apply(self, wanted: Wanted, now: float) -> None:
        """The newest replaces what was wanted."""
        is_stop = wanted is None or isinstance(wanted, Stop | EmergencyStop)
        self.driving = not is_stop and not wanted.is_zero  # type: ignore[union-attr]
        self._listener.wanted(estop=isinstance(wanted, EmergencyStop))
        if not self.driving:
            self._pair.begin()
        super().apply(wanted, now)

    def angle_told(self, angle_rad: float, now: float) -> bool:
        """The front wheel stands here. Whether it shows now that it does not follow."""
        if self.driving and self._pair.restless:
            self._said_at = -math.inf
        return self._pair.follower.look(angle_rad, now)
