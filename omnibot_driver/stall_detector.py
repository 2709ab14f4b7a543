# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Detection of stalls of this process: SIGSTOP, a swapped-out or suspended host, a hanging thread.

During a stall the watchdog does not run either, and commands keep arriving. When the process runs
again, commands that were sent meanwhile must not be obeyed. Callers pass the time of
``boot_time_s``, and the watchdog's thread calls ``passed`` to show that it runs. This module must
not know threads or commands.
"""

import math
import time
from typing import Final

STANDSTILL_S: Final = 0.4
"""Time without a call of ``passed``, in s, from which the process is regarded as stalled.
``passed`` should be called ten times a second. The guard waits longer before it acts, so the driver
notices every stall in which the guard acts."""
SETTLE_S: Final = 0.25
"""Time after a stall, in s. A command that arrives within this time is regarded as sent during the
stall, whatever its send time. A command that was sent within this time is regarded as sent during
the stall too, because a sender's clock is known only roughly."""
LATEST_S: Final = 10.0
"""Longest assumed time in transit, in s, retransmissions included. A command that seems to be older
comes from a sender whose clock is wrong."""


def boot_time_s() -> float:
    """Return a steady time in s that includes the time for which the host was suspended."""
    return boot_time_ns() / 1e9


def boot_time_ns() -> int:
    """Return the time of ``boot_time_s`` in ns."""
    return time.clock_gettime_ns(time.CLOCK_BOOTTIME)


class StallDetector:
    """The state of the present stall and the end of the last one.

    The watchdog's thread calls ``passed``; every thread calls ``begun`` before it acts.
    ``outlived_by`` is never True while ``begun`` would report a stall.

    All times are kept by the steady clock, so a step of the time of day does not change them. Each
    call of ``passed`` measures the difference of the time of day from the steady clock.
    """

    def __init__(self) -> None:
        self._passed_at = math.inf
        self._begun = False
        self._over_at = -math.inf
        self._from_ns = self._until_ns = 0
        self._day_ns = 0
        """Time of day at which the steady clock showed 0, in ns."""

    def begun(self, now: float) -> float:
        """Return the length of a stall so far, in s, at the first call in the stall; else 0."""
        length_s = now - self._passed_at
        if self._begun or length_s < STANDSTILL_S:
            return 0.0
        self._begun = True
        return length_s

    def passed(self, now: float, wall_ns: int) -> None:
        """Record that the watchdog's thread runs; ``wall_ns`` is the time of day in ns."""
        if self._begun:
            self._begun = False
            if now >= self._over_at + LATEST_S:  # else commands from that stall may still arrive
                self._from_ns = _ns(self._passed_at - LATEST_S)
            self._over_at = now
            self._until_ns = _ns(now + SETTLE_S)
        self._passed_at = now
        self._day_ns = wall_ns - round(now * 1e9)

    def outlived_by(self, sent_ns: int, now: float) -> bool:
        """Return False for a command that may have been sent before or during a recent stall.

        ``sent_ns`` is the time of day at which the command was sent, in ns.
        """
        if self._begun or now - self._passed_at >= STANDSTILL_S or now < self._over_at + SETTLE_S:
            return False
        if now >= self._over_at + LATEST_S:
            return True
        return not self._from_ns <= sent_ns - self._day_ns <= self._until_ns


def _ns(seconds: float) -> int:
    return round(seconds * 1e9)
