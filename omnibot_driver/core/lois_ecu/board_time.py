# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Estimation of the delay with which each tick report was read.

The arrival time is compared with the board's clock. By the manual, this clock always runs; in the
public firmware, it stops while the board sends.
"""

import math
from collections import deque
from collections.abc import Sequence
from operator import itemgetter
from statistics import median
from typing import Final

from omnibot_driver.core.lois_ecu.plausibility import ClockUnit, wrapped

LINE_S: Final = 14 * 10 / 115200
GROUPS_KEPT: Final = 25
"""Number of stored tick reports. They usually cover five seconds. In this time, a clock error of
100 ppm changes the measured delay of a report by 0.5 ms.
"""
FEWEST: Final = 8
LATEST_S: Final = 0.25
"""Longest plausible delay, in s, from the board's time of a tick report to the driver's read.

A longer delay means that the board has restarted, or that its clock has another unit.
"""
UNKNOWN_S: Final = 0.012
"""Assumed standard deviation of an arrival time in s, while the unit of the board's clock is
unknown."""
LEAST_S: Final = 0.001
SAME_READ_S: Final = 0.02
"""Tick reports that arrive within this time in s were probably read together, and late. Only
the last one, with the smallest delay, is stored."""
DISAGREES_S: Final = 0.03
"""Margin, in s, beyond which the delay of a tick report is irregular.

A regular delay, by the fitted clock, lies between 0 and the largest recent delay, with this margin
on both sides.
"""
Point = tuple[float, float]
"""Arrival time in s, and the arrival time minus the board's time, in s."""
UNIT_S: Final[dict[ClockUnit, float]] = {"ms": 1e-3, "ns": 1e-9}


class BoardTime:
    """Estimator of the delay with which each tick report is read.

    ``stddev_s``: standard deviation of the delay, in s.
    """

    def __init__(self) -> None:
        self.stddev_s = UNKNOWN_S
        self.begin()

    def begin(self) -> None:
        """Forget the board's clock, because the board was reconnected or restarted."""
        self._before: tuple[int, float] | None = None
        self._behind_s = [0.0, 0.0]
        """Two values in s: how far the board's clock has fallen behind since the first tick report.

        The first value assumes that the clock always runs (manual), the second that it stops during
        sending (public firmware).
        """
        self._kept: tuple[deque[Point], deque[Point]] = (
            deque(maxlen=GROUPS_KEPT),
            deque(maxlen=GROUPS_KEPT),
        )
        self._lines = 0
        self._taken_s = -math.inf
        self.stddev_s = UNKNOWN_S

    def sent(self, lines: int) -> None:
        """Record that the board sent ``lines`` lines.

        The board's clock may have stopped while the board sent these lines.
        """
        self._lines += lines

    def late_s(self, counts: int, unit: ClockUnit | None, now: float) -> float:
        """Return the delay in s, at least 0, of ticks that arrive at ``now``.

        ``now`` minus the delay never decreases from call to call.
        """
        late_s = max(min(self._above_s(counts, unit, now), now - self._taken_s), 0.0)
        self._taken_s = now - late_s
        return late_s

    def deviation_s(self, counts: int, unit: ClockUnit | None, now: float) -> tuple[float, bool]:
        """Return the delay of a tick report in s by the fitted clock, and whether it is irregular.

        A delay is irregular if a late read does not explain it. If the unit of the board's clock is
        unknown, or too few reports are stored, return 0 and False. This report is not stored.
        """
        if unit is None or self._before is None or len(self._kept[0]) < FEWEST:
            return 0.0, False
        before, at_s = self._before
        elapsed = round((now - at_s) / UNIT_S[unit])
        # A clock in ns wraps every 4.3 s, so only the difference of times is unwrapped.
        changed_s = -wrapped(counts - before - elapsed) * UNIT_S[unit]
        found = []
        for index, sending_s in enumerate((0.0, self._lines * LINE_S)):
            points = self._kept[index]
            slope, least = _line_below(points)
            usual_s = max(behind_s - slope * at for at, behind_s in points) - least
            behind_s = self._behind_s[index] + changed_s - sending_s
            found.append((usual_s, behind_s - slope * now - least))
        usual_s, late_s = min(found)
        return late_s, max(-late_s, late_s - usual_s) > DISAGREES_S

    def _above_s(self, counts: int, unit: ClockUnit | None, now: float) -> float:
        if unit is None:
            return 0.0
        lines, self._lines = self._lines, 0
        before, self._before = self._before, (counts, now)
        if before is None:
            return 0.0
        arrived_s = now - before[1]
        passed_s = wrapped(counts - before[0]) * UNIT_S[unit]
        if abs(arrived_s - passed_s) > LATEST_S + 0.5 * arrived_s:
            self.begin()
            return 0.0
        # The clock of the public firmware stops while the board sends. So the clock falls behind by
        # 4 to 36 %, about 1.2 ms for each line.
        for index, sending_s in enumerate((0.0, lines * LINE_S)):
            self._behind_s[index] += arrived_s - passed_s - sending_s
            kept = self._kept[index]
            if kept and now - kept[-1][0] < SAME_READ_S:
                kept.pop()
            kept.append((now, self._behind_s[index]))
        if len(self._kept[0]) < FEWEST:
            return 0.0
        late = min(map(_above_line, self._kept), key=max)
        self.stddev_s = max(median(late), LEAST_S)
        return late[-1] if late[-1] < LATEST_S else 0.0


def _above_line(kept: Sequence[Point]) -> list[float]:
    """Return the delay of each stored tick report, in s.

    The delay is the height of the report's point above the straight line from ``_line_below``.
    """
    slope, least = _line_below(kept)
    return [behind_s - slope * at_s - least for at_s, behind_s in kept]


def _line_below(kept: Sequence[Point]) -> Point:
    """Return slope and height (at time 0) of a straight line below the points.

    The line touches at least one point. All other points lie on the line or above it.
    """
    half = len(kept) // 2
    points = list(kept)
    # A read may be late but never early, so the line lies below all arrivals. Its slope is that
    # between the lowest points of both halves.
    first_s, first = min(points[:half], key=itemgetter(1))
    second_s, second = min(points[half:], key=itemgetter(1))
    slope = (second - first) / (second_s - first_s)
    return slope, min(behind_s - slope * at_s for at_s, behind_s in points)
