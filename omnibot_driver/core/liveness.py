# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""When the board was heard last, and from when on that is too long ago.

Knows two times and two limits; not what a board says, nor what is done about its silence. Time is
an argument.
"""

import math

from omnibot_driver.core.traits import Traits


class Liveness:
    """``heard_at``: when the last reading came; ``came_at``: when the last bytes came.

    ``unheard_s`` and ``silence_s`` are those of ``Traits``.
    """

    def __init__(self, traits: Traits) -> None:
        self.unheard_s, self.silence_s = traits.unheard_s, traits.silence_s
        self.heard_at = self.came_at = -math.inf
        self._silent_since: float | None = None
        """The silence that is known: ``heard_at`` when it was found."""

    def begin(self, now: float) -> None:
        """Begin a new connection."""
        self.heard_at, self.came_at = now, -math.inf
        self._silent_since = None

    def stalled(self, now: float) -> None:
        """This process did not run: the silence until now was not the board's."""
        if self._silent_since == self.heard_at:
            self._silent_since = now
        self.heard_at = now

    def unheard(self, now: float) -> bool:
        """Whether the board has been silent for too long to drive the robot."""
        return now - self.heard_at >= self.unheard_s

    def fell_silent(self, now: float) -> bool:
        """Whether a silence has just become too long: True once for each silence."""
        if self._silent_since == self.heard_at or now - self.heard_at < self.silence_s:
            return False
        self._silent_since = self.heard_at
        return True

    def wake_at(self, *, driven: bool) -> float:
        """The time of the next check. ``driven``: whether a command is carried out."""
        unheard_at = self.heard_at + self.unheard_s if driven else math.inf
        if self._silent_since == self.heard_at:
            return unheard_at
        return min(unheard_at, self.heard_at + self.silence_s)
