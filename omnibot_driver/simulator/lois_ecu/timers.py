# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Periods of the board's messages. This module knows the board's clock and the command numbers."""

from collections.abc import Iterator
from dataclasses import dataclass

PERIODS_MS = {0x0D: 1200, 0x0E: 1000, 0x0F: 0xFFFF, 0x10: 400, 0x12: 400, 0x20: 400}
ONCE, NEVER = 0xFFFE, 0xFFFF


@dataclass(slots=True)
class Timer:
    """Period of one message, and the time at which the current period began. Both are in ms."""

    period_ms: int
    since_ms: int = 0


class Timers:
    """Timers of all periodic messages, by command number.

    They are in the order in which the board checks them.
    """

    def __init__(self) -> None:
        self._timers = {code: Timer(period) for code, period in PERIODS_MS.items()}
        self._none_due_ms = -1
        """Time by the board's clock, in ms, until which no message is due."""

    def __iter__(self) -> Iterator[int]:
        return iter(self._timers)

    def __contains__(self, code: int) -> bool:
        return code in self._timers

    def __getitem__(self, code: int) -> Timer:
        return self._timers[code]

    def set(self, code: int, period_ms: int, clock_ms: int) -> None:
        """Set the period of a message in ms, and begin a new period now."""
        self._timers[code] = Timer(period_ms, clock_ms)
        self._none_due_ms = -1

    def restart(self, clock_ms: int) -> None:
        """Begin new periods of all messages."""
        for timer in self._timers.values():
            timer.since_ms = clock_ms
        self._none_due_ms = -1

    def any_due(self, clock_ms: int) -> bool:
        """Return whether a message is due."""
        if clock_ms <= self._none_due_ms:
            return False
        timers = [timer for timer in self._timers.values() if timer.period_ms != NEVER]
        if any(timer.period_ms == ONCE for timer in timers):
            return True
        self._none_due_ms = min(
            (timer.since_ms + timer.period_ms for timer in timers), default=clock_ms
        )
        return clock_ms > self._none_due_ms

    def take(self, code: int, clock_ms: int) -> bool:
        """Return whether the message ``code`` is due. If so, begin its next period."""
        timer = self._timers[code]
        if timer.period_ms == NEVER:
            return False
        if timer.period_ms == ONCE:
            timer.period_ms = NEVER
            return True
        if clock_ms - timer.since_ms <= timer.period_ms:
            return False
        timer.since_ms = clock_ms
        return True
