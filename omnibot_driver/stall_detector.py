# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Did this process stand still? SIGSTOP, a swapped-out or suspended host, a thread that hangs.

While it did, its watchdog did too, and commands went on arriving for it. So when it runs again,
nothing that was sent meanwhile is still a command. This module gets the time and whether the
watchdog's thread runs; it knows no threads and no commands. Its time is ``boot_time_s``.
"""

import math
import time
from typing import Final

STANDSTILL_S: Final = 0.4
"""A thread that should pass ten times a second has not passed for this time. It is less than the
guard's limit: whenever the guard steps in, this is noticed as well."""
SETTLE_S: Final = 0.25
"""What comes so soon after a standstill had been waiting, whatever the sender's clock says. What
was sent so soon after it may have been sent a little before: a sender's clock is known roughly."""
LATEST_S: Final = 10.0
"""Nothing is under way for longer, retransmissions included. What seems to have been sent earlier
has a sender whose clock is wrong."""


def boot_time_s() -> float:
    """A steady clock that also counts the time for which the host was suspended."""
    return boot_time_ns() / 1e9


def boot_time_ns() -> int:
    """The same in ns."""
    return time.clock_gettime_ns(time.CLOCK_BOOTTIME)


class StallDetector:
    """``passed`` by the watchdog's thread, ``begun`` by every thread before it does something.

    ``outlived_by`` is never true of what ``begun`` would tell.
    """

    def __init__(self) -> None:
        self._passed_at = math.inf
        self._begun = False
        self._over_at = -math.inf
        self._from_ns = self._until_ns = 0

    def begun(self, now: float) -> float:
        """Its length in seconds so far, once for each standstill; otherwise 0."""
        length_s = now - self._passed_at
        if self._begun or length_s < STANDSTILL_S:
            return 0.0
        self._begun = True
        return length_s

    def passed(self, now: float, wall_ns: int) -> None:
        """Note that the watchdog's thread runs; ``wall_ns`` is the time of day."""
        if self._begun:
            self._begun = False
            if now >= self._over_at + LATEST_S:  # else commands of the last one are still under way
                self._from_ns = wall_ns - _ns(now - self._passed_at + LATEST_S)
            self._over_at = now
            self._until_ns = wall_ns + _ns(SETTLE_S)
        self._passed_at = now

    def outlived_by(self, sent_ns: int, now: float) -> bool:
        """A command that was sent at this time of day, as far as is known, is not from before its
        end.
        """
        if self._begun or now - self._passed_at >= STANDSTILL_S or now < self._over_at + SETTLE_S:
            return False
        return now >= self._over_at + LATEST_S or not self._from_ns <= sent_ns <= self._until_ns


def _ns(seconds: float) -> int:
    return round(seconds * 1e9)
