# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Detection of stalls: times in which this process, or its pacer thread, did not run.

A command that was sent during a stall must not be obeyed. Every ``now`` is a time of
``boot_time_s``. This module does not know threads.
"""

import math
import time
from typing import Final

STANDSTILL_S: Final = 0.4
"""Duration, in s, from which a pause between calls of ``StallDetector.passed`` is a stall. This
limit must be shorter than the guard's."""
SETTLE_S: Final = 0.25
"""Time in s after a stall in which the driver still refuses commands. The sender's clock is known
only roughly, so these commands may have been sent during the stall."""
LATEST_S: Final = 10.0
"""Longest assumed time in s from the sending of a command to its arrival, retransmissions included.
A stamp that is older comes from a wrong clock."""


def boot_time_s() -> float:
    """Return a steady time in s that includes the time for which the host was suspended."""
    return boot_time_ns() / 1e9


def boot_time_ns() -> int:
    """Return a steady time in ns that includes the time for which the host was suspended."""
    return time.clock_gettime_ns(time.CLOCK_BOOTTIME)


class StallDetector:
    """A detector of stalls of this process.

    The pacer thread calls ``passed`` at least ten times a second. Other threads call ``begun``
    before they use the session, and stop the robot after a stall.
    """

    def __init__(self) -> None:
        self._passed_at = math.inf
        self._begun = False
        self._over_at = -math.inf
        self._from_ns = self._until_ns = 0
        self._day_ns = 0
        """Time of day, in ns, at which the steady clock showed 0. It changes if the computer's
        clock is set."""

    def begun(self, now: float) -> float:
        """Return the length in s of a stall that was not reported before; otherwise 0.

        After a stall, only the first thread that calls this method gets the length.
        """
        length_s = now - self._passed_at
        if self._begun or length_s < STANDSTILL_S:
            return 0.0
        self._begun = True
        return length_s

    def passed(self, now: float, wall_ns: int) -> None:
        """Record that the pacer thread runs now, which ends a stall.

        ``wall_ns``: the current time of day, in ns.
        """
        if self._begun:
            self._begun = False
            # If commands from the previous stall may still arrive, the start of that stall is kept.
            if now >= self._over_at + LATEST_S:
                self._from_ns = _ns(self._passed_at - LATEST_S)
            self._over_at = now
            self._until_ns = _ns(now + SETTLE_S)
        self._passed_at = now
        self._day_ns = wall_ns - round(now * 1e9)

    def outlived_by(self, sent_ns: int, now: float) -> bool:
        """Return whether a command is regarded as newer than the last stall; False if uncertain.

        ``sent_ns``: when the command was sent, as time of day in ns.
        """
        if self._begun or now - self._passed_at >= STANDSTILL_S or now < self._over_at + SETTLE_S:
            return False
        if now >= self._over_at + LATEST_S:
            return True
        return not self._from_ns <= sent_ns - self._day_ns <= self._until_ns


def _ns(seconds: float) -> int:
    return round(seconds * 1e9)
