# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Whether the drive board obeys, by its heartbeat, and why not: paused, or our own e-stop.

``stop`` serves both the e-stop and the pause. An e-stop of ours is not taken for a pause, and its
release sends ``start`` until the heartbeat shows that the board obeys; a pause outlives both. Knows
rcSource and times; no lines.
"""

import math
from typing import Final

STOPPED: Final = -1.0
"""rcSource of a drive board that obeys nothing (manual, start)."""
RELEASED_S: Final = 1.0
"""How long ``start`` is repeated after an e-stop; a stopped board is expected meanwhile."""
START_AGAIN_S: Final = 0.2


class Obedience:
    """``source``: rcSource as it was heard last. ``estopped``: our e-stop is latched.

    ``pause_said``: a pause was asked for since the last start.
    """

    def __init__(self) -> None:
        self.estopped = False
        self._resume = False
        self.begin()

    def begin(self) -> None:
        """The line is new; a latched e-stop stays."""
        self.source: float | None = None
        self.pause_said = False
        self._released_at = -math.inf
        self.start_at = math.inf
        """When ``start`` is to be sent."""

    def hear(self, source: float) -> None:
        """A heartbeat of the drive board."""
        self.source = source
        if source != STOPPED:
            self.start_at = math.inf

    def latch(self, *, running: bool) -> None:
        """Our e-stop; ``running``: the board obeyed until now."""
        if not self.estopped:
            self._resume = running
        self.estopped = True
        self.start_at = math.inf

    def pause(self) -> None:
        """A pause is asked for, which a ``start`` for a released e-stop must not follow."""
        self.pause_said = True
        self.start_at = math.inf

    def release(self, now: float) -> None:
        """The end of our e-stop; a board that did not obey before is left as it is."""
        if self.estopped and self._resume and not self.pause_said:
            self._released_at, self.start_at = now, -math.inf
        self.estopped = False

    def stopped(self, now: float, *, was_paused: bool) -> bool:
        """Whether the drive board obeys nothing, and not because of an e-stop of ours."""
        if self.source != STOPPED:
            return False
        if self.pause_said or was_paused:
            return True
        return not self.estopped and now - self._released_at > RELEASED_S

    def start_due(self, now: float) -> bool:
        """Whether to send ``start`` now; it counts as sent."""
        if now < self.start_at:
            return False
        again = now - self._released_at < RELEASED_S
        self.start_at = now + START_AGAIN_S if again else math.inf
        return True
