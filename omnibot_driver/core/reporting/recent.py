# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The figures of the last ten seconds, from which the diagnosis is made."""

import math
from collections import deque
from typing import Final

from omnibot_driver.core.board import RateName
from omnibot_driver.core.reporting.figures import LinkFigures, SessionFigures

RECENT_S: Final = 10.0
"""Time in s for which figures are kept. An event also affects the diagnosis for this time."""


class RecentFigures:
    """The session's figures of the last 10 s.

    If the session's state has changed in this time, there are only the figures since this change.
    """

    def __init__(self) -> None:
        self._counts: dict[str, tuple[int, float]] = {}
        self._window: deque[tuple[float, SessionFigures]] = deque()
        self._waits: deque[tuple[float, float]] = deque()

    def remember(self, session: SessionFigures, now: float) -> None:
        """Add the session's figures; forget all earlier ones if the session's state has changed."""
        if self._window and self._window[-1][1].state != session.state:
            self._window.clear()
        self._window.append((now, session))
        while now - self._window[0][0] > RECENT_S:
            self._window.popleft()

    def grew(self, name: str, count: int, now: float) -> bool:
        """Store ``count`` as the latest value of the counter ``name``.

        Return whether this counter has grown in the last 10 s.
        """
        before, at = self._counts.get(name, (count, -math.inf))
        if count > before:
            at = now
        self._counts[name] = (count, at)
        return now - at < RECENT_S

    def waiting_share(self, link: LinkFigures, now: float) -> float:
        """Return the share of the last 10 s, 0 to 1, in which the reader waited for a processor."""
        if link.waited_s is None:
            return 0.0
        self._waits.append((now, link.waited_s))
        while now - self._waits[0][0] > RECENT_S:
            self._waits.popleft()
        since, before_s = self._waits[0]
        return (link.waited_s - before_s) / (now - since) if now > since else 0.0

    @property
    def span_s(self) -> float:
        """Time in s from the first to the last stored figures."""
        return self._window[-1][0] - self._window[0][0]

    def rates_hz(self) -> dict[RateName, float] | None:
        """Return the recent rate of each kind of reading in Hz.

        The result is None directly after a change of the session's state.
        """
        if not self.span_s:
            return None
        old, new = self._window[0][1].tally, self._window[-1][1].tally
        counts: dict[RateName, int] = {
            "IMU": new.imu - old.imu,
            "Odometry": new.displacements - old.displacements,
            "Pose": new.poses - old.poses,
        }
        return {name: count / self.span_s for name, count in counts.items()}

    def delay_s(self) -> tuple[float, float] | None:
        """Return mean and standard deviation of recent reads' delays, in s; None without reads.

        Delays are relative to the least delayed read.
        """
        old, new = self._window[0][1].tally, self._window[-1][1].tally
        reads = new.reads - old.reads
        if not reads:
            return None
        mean_s = (new.delay_s - old.delay_s) / reads
        variance = (new.squared_delay_s2 - old.squared_delay_s2) / reads - mean_s * mean_s
        return mean_s, math.sqrt(max(0.0, variance))
