# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Liveness of the board: when it last sent data, and whether its silence is too long.

Time is an argument.
"""

import math

from omnibot_driver.core.traits import Traits


class Liveness:
    """The times at which a board last sent data, and the limits for its silence.

    * ``heard_at``: arrival of the last reading, start of the connection, or end of a stall, in s.
    * ``came_at``: arrival of the last bytes, valid or not, in s.
    """

    def __init__(self, traits: Traits) -> None:
        self.unheard_s, self.silence_s = traits.unheard_s, traits.silence_s
        self.heard_at = self.came_at = -math.inf
        self._silent_since: float | None = None
        """Value of ``heard_at`` when a silence was last reported. The same value means the same
        silence, which is reported only once.
        """

    def begin(self, now: float) -> None:
        """Begin a new connection."""
        self.heard_at, self.came_at = now, -math.inf
        self._silent_since = None

    def stalled(self, now: float) -> None:
        """Measure the board's silence from ``now`` on, because this process has stalled until now.

        A silence that was reported before the stall is not reported again.
        """
        if self._silent_since == self.heard_at:
            self._silent_since = now
        self.heard_at = now

    def unheard(self, now: float) -> bool:
        """Return whether the board has been silent so long that the robot must be stopped."""
        return now - self.heard_at >= self.unheard_s

    def is_silent(self, now: float) -> bool:
        """Return whether the board is silent.

        The board is silent from the opening of the port to the first bytes, and after
        ``Traits.silence_s`` without a reading.
        """
        return self.came_at == -math.inf or now - self.heard_at >= self.silence_s

    def fell_silent(self, now: float) -> bool:
        """Return True once for each silence of the board, after ``Traits.silence_s``."""
        if self._silent_since == self.heard_at or now - self.heard_at < self.silence_s:
            return False
        self._silent_since = self.heard_at
        return True

    def wake_at(self, *, driven: bool) -> float:
        """Return the time of the next check, in s. ``driven``: whether a command is in effect."""
        unheard_at = self.heard_at + self.unheard_s if driven else math.inf
        if self._silent_since == self.heard_at:
            return unheard_at
        return min(unheard_at, self.heard_at + self.silence_s)
