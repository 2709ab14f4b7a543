# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Estimation of the delay with which a group of ticks was read, from the board's time in the group.

The clock of the public firmware stops while the board sends. So it falls behind by 4 to 36 % of
real time. The missing time can be added: the number of sent lines is known, and each line takes
about 1.2 ms. The clock of a board as in the manual does not stop. Both models of the clock are
fitted to the last arrivals, and the better fit is used.

Each fit is a straight line below all arrivals, because a read may be late but never early.

This module works on clock counts, numbers of lines and arrival times.
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
"""Number of stored groups. At the usual period, the board sends them in five seconds. In this time,
a clock with an error of 100 ppm drifts by 0.5 ms."""
FEWEST: Final = 8
LATEST_S: Final = 0.25
"""Longest plausible delay in s. A longer delay means that the board has restarted, or that its
clock has another unit."""
UNKNOWN_S: Final = 0.012
"""Assumed standard deviation of an arrival time in s, while the unit of the board's clock is
unknown."""
LEAST_S: Final = 0.001
SAME_READ_S: Final = 0.02
"""If two groups arrive within this time in s, the reader had probably paused, and then read both at
once. Only the last of such groups is stored, because its delay is the smallest."""
Point = tuple[float, float]
"""Arrival time in s, and the arrival time minus the board's time, in s."""
UNIT_S: Final[dict[ClockUnit, float]] = {"ms": 1e-3, "ns": 1e-9}


class BoardTime:
    """Estimator of the delay of each group of ticks.

    ``stddev_s``: standard deviation of the delay, in s.
    """

    def __init__(self) -> None:
        self.stddev_s = UNKNOWN_S
        self.begin()

    def begin(self) -> None:
        """Forget the board's clock, because the board was reconnected or restarted."""
        self._before: tuple[int, float] | None = None
        self._behind_s = [0.0, 0.0]
        """Arrival time minus board time, both counted from the first group, in s. The first value
        is for a clock that always runs, the second for a clock that stops while lines are sent."""
        self._kept: tuple[deque[Point], deque[Point]] = (
            deque(maxlen=GROUPS_KEPT),
            deque(maxlen=GROUPS_KEPT),
        )
        self._lines = 0
        self._taken_s = -math.inf
        self.stddev_s = UNKNOWN_S

    def sent(self, lines: int) -> None:
        """Add ``lines`` to the number of lines that the board has sent."""
        self._lines += lines

    def late_s(self, counts: int, unit: ClockUnit | None, now: float) -> float:
        """Return the delay in s of ticks that arrive at ``now``.

        The delay is at least zero. The corrected time, ``now`` minus the delay, is never earlier
        than the corrected time of the previous call.
        """
        late_s = max(min(self._above_s(counts, unit, now), now - self._taken_s), 0.0)
        self._taken_s = now - late_s
        return late_s

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
    """Return the height of each point above a straight line that touches the points from below.

    The slope of the line is taken from two points: the lowest point of the first half and the
    lowest point of the second half.
    """
    half = len(kept) // 2
    points = list(kept)
    first_s, first = min(points[:half], key=itemgetter(1))
    second_s, second = min(points[half:], key=itemgetter(1))
    slope = (second - first) / (second_s - first_s)
    heights = [behind_s - slope * at_s for at_s, behind_s in points]
    least = min(heights)
    return [height - least for height in heights]
