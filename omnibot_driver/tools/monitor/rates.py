# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Measures how often messages arrive.

This module must not depend on the content of messages, and must not read a clock.
"""

from collections import deque
from typing import Final

WINDOW_S: Final = 2.0
HISTORY_S: Final = 60


class Rate:
    """The number and rate of messages since ``began_s``.

    All times are of one clock, in s. They must not decrease.
    """

    def __init__(self, began_s: float) -> None:
        self._began_s = began_s
        self._recent_s: deque[float] = deque()
        self._seconds: deque[int] = deque([0], maxlen=HISTORY_S + 1)
        self._latest_second = 0
        self.count = 0

    def arrived(self, now_s: float) -> None:
        """Count a message."""
        self.count += 1
        self._recent_s.append(now_s)
        self._forget(now_s)
        self._seconds[-1] += 1

    def hz(self, now_s: float) -> float:
        """Return the message rate in Hz over the last 2 s.

        If ``began_s`` is less than 2 s ago, the rate is measured since ``began_s``.
        """
        self._forget(now_s)
        span_s = min(WINDOW_S, now_s - self._began_s)
        return len(self._recent_s) / span_s if span_s > 0.0 else 0.0

    def age_s(self, now_s: float) -> float | None:
        """Return the age of the last message, in s; None if the age is above 2 s."""
        self._forget(now_s)
        return now_s - self._recent_s[-1] if self._recent_s else None

    def history(self, now_s: float) -> tuple[int, ...]:
        """Return how many messages came in each full second of the last minute."""
        self._forget(now_s)
        return tuple(self._seconds)[:-1]

    def _forget(self, now_s: float) -> None:
        while self._recent_s and now_s - self._recent_s[0] >= WINDOW_S:
            self._recent_s.popleft()
        second = int(now_s - self._began_s)
        self._seconds.extend([0] * min(second - self._latest_second, HISTORY_S + 1))
        self._latest_second = second
