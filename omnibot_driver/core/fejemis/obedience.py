# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Finds out from heartbeats whether the drive board obeys motion commands.

When an e-stop is released, the driver sends ``start`` by itself; after a pause, only at the user's
request.
"""

import math
from typing import Final

STOPPED: Final = -1.0
"""Value of rcSource while the drive board ignores all motion commands.

Source: the manual's text on the command ``start``.
"""
RELEASED_S: Final = 1.0
"""Time in s after the release of an e-stop during which ``start`` is repeated."""
START_AGAIN_S: Final = 0.2


class Obedience:
    """Whether the drive board obeys motion commands, and why not.

    * ``estopped``: whether the driver's e-stop is latched.
    * ``source``: the last rcSource, the source of the obeyed commands, or None.
    * ``pause_said``: whether the user has requested a pause since the last start.
    """

    def __init__(self) -> None:
        self.estopped = False
        self.pause_said = False
        self._resume = False
        self.begin()

    def begin(self) -> None:
        """Begin a new connection. A latched e-stop and a requested pause remain in effect."""
        self.source: float | None = None
        self._released_at = -math.inf
        self.start_at = math.inf
        """Time in s at which to send ``start``; infinity if there is no reason to send it."""

    def hear(self, source: float) -> None:
        """Receive rcSource, the source of the commands that the drive board obeys.

        Each heartbeat of the board contains it.
        """
        self.source = source
        if source != STOPPED:
            self.start_at = math.inf

    def latch(self, *, running: bool) -> None:
        """Latch the driver's e-stop, which is not latched yet.

        ``running``: whether the drive board obeys motion commands at this moment.
        """
        self._resume = running
        self.estopped = True
        self.start_at = math.inf

    def pause(self) -> None:
        """Record that the user requested a pause.

        If ``start`` was due because an e-stop was released, the pause cancels this ``start``.
        """
        self.pause_said = True
        self.start_at = math.inf

    def release(self, now: float) -> None:
        """Release the driver's e-stop.

        The driver must then send ``start`` if the drive board obeyed motion commands before the
        e-stop, and the user has not requested a pause.
        """
        if self.estopped and self._resume and not self.pause_said:
            self._released_at, self.start_at = now, -math.inf
        self.estopped = False

    def stopped(self, now: float, *, was_paused: bool) -> bool:
        """Return whether the drive board is stopped for a reason other than the driver's e-stop."""
        if self.source != STOPPED:
            return False
        if self.pause_said or was_paused:
            return True
        return not self.estopped and now - self._released_at > RELEASED_S

    def start_due(self, now: float) -> bool:
        """Return whether to send ``start`` now. If True, the caller must send it."""
        if now < self.start_at:
            return False
        again = now - self._released_at < RELEASED_S
        self.start_at = now + START_AGAIN_S if again else math.inf
        return True
