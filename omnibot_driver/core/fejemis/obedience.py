# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Finds from heartbeats whether the drive board obeys; distinguishes a pause from an e-stop.

For a pause and for its own e-stop, the driver sends ``stop`` to the board. After the release of the
e-stop, the driver sends ``start`` until the heartbeat shows that the board obeys. A pause remains
until the user calls start. The module knows times and rcSource (the source of commands that the
board obeys, by its own report), not lines.
"""

import math
from typing import Final

STOPPED: Final = -1.0
"""rcSource of a drive board that ignores all motion commands (manual, start)."""
RELEASED_S: Final = 1.0
"""Longest time in s for which ``start`` is repeated after the release of an e-stop."""
START_AGAIN_S: Final = 0.2


class Obedience:
    """Obedience of the drive board; ``source``: the last rcSource, None before the first.

    ``estopped``: whether the driver's e-stop is latched. ``pause_said``: whether a pause was
    requested after the last start.
    """

    def __init__(self) -> None:
        self.estopped = False
        self._resume = False
        self.begin()

    def begin(self) -> None:
        """Begin a new connection; a latched e-stop stays."""
        self.source: float | None = None
        self.pause_said = False
        self._released_at = -math.inf
        self.start_at = math.inf
        """Time in s at which to send ``start``; infinity if ``start`` is not due."""

    def hear(self, source: float) -> None:
        """Take rcSource from a heartbeat of the drive board."""
        self.source = source
        if source != STOPPED:
            self.start_at = math.inf

    def latch(self, *, running: bool) -> None:
        """Latch the driver's e-stop; ``running``: whether the board obeyed until now."""
        if not self.estopped:
            self._resume = running
        self.estopped = True
        self.start_at = math.inf

    def pause(self) -> None:
        """Record a requested pause, and cancel a ``start`` that is due after an e-stop."""
        self.pause_said = True
        self.start_at = math.inf

    def release(self, now: float) -> None:
        """Release the driver's e-stop; ``start`` is due if the board obeyed before the e-stop."""
        if self.estopped and self._resume and not self.pause_said:
            self._released_at, self.start_at = now, -math.inf
        self.estopped = False

    def stopped(self, now: float, *, was_paused: bool) -> bool:
        """Return whether the drive board is stopped for another reason than the driver's e-stop."""
        if self.source != STOPPED:
            return False
        if self.pause_said or was_paused:
            return True
        return not self.estopped and now - self._released_at > RELEASED_S

    def start_due(self, now: float) -> bool:
        """Return whether to send ``start`` now; if so, regard ``start`` as sent."""
        if now < self.start_at:
            return False
        again = now - self._released_at < RELEASED_S
        self.start_at = now + START_AGAIN_S if again else math.inf
        return True
