# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The fitted clock: a straight line that gives the time of each tick.

The line is fitted to upper and lower bounds of the times. A *latest* point (n, t) is an upper
bound: a read at time t contained tick n, so the tick was not later. An *earliest* point (n, t) is a
lower bound: a read at time t did not contain tick n yet, so the tick was not earlier.
docs/internals/time.md explains the fit.

This module knows ticks and times; it does not know what is sampled, nor how ticks are counted.
"""

import math
from collections import deque
from itertools import pairwise
from typing import Final

BLOCK_TICKS: Final = 100
"""Number of ticks in a block: one second of 10 ms ticks."""
BLOCKS_KEPT: Final = 75
"""Number of blocks that are kept: 75 s of 10 ms ticks.

The blocks must cover more than 20 s: with clocks that differ by 100 ppm, an adapter's smallest
delay may occur only every 20 s.
"""
LARGEST_SKEW: Final = 1.2e-4
"""Largest assumed relative deviation of the board's crystal from the host's: 100 ppm plus a margin
of 20 ppm."""
SUPPORT: Final = 0.75
"""Position, from 0 (oldest) to 1 (newest), among the arrival times in use. The edge of their lower
convex hull at this position becomes the fitted clock, if there are no lower bounds.

With a larger value, the clock follows recent arrival times more closely, with more jitter.
"""
FEWEST_READS: Final = 12
"""Smallest number of reads in a block from which a lower bound is derived. With fewer reads, the
late ones cannot be recognized."""
LATE_PART: Final = 0.1
"""Largest assumed fraction of reads that are late. A read is late if it is delayed by more than
``LATE_S``, in s."""
LATE_S: Final = 1e-4
WIDEST: Final = 0.2
"""Largest distance, in periods, between the upper and the lower bound from ``BLOCK_TICKS`` ticks.
Beyond it, the lower bound is not used. An adapter's 16 ms timer causes a distance below 0.2 (2 ms).
"""

Point = tuple[int, float]
"""The number of a tick, and an upper or lower bound of its time, in s."""


class ClockFit:
    """The fitted clock. It gives the time of each tick.

    * ``slope_s``: the fitted period of the ticks in s. ``period_s``: the nominal period.
    """

    def __init__(self, period_s: float, first: Point) -> None:
        self.slope_s = period_s
        self._period_s = period_s
        self._anchor = first
        self._latest: deque[tuple[Point, bool]] = deque(maxlen=BLOCKS_KEPT)
        self._earliest: deque[Point] = deque(maxlen=BLOCKS_KEPT)
        self._best: tuple[Point, bool] | None = None
        self._best_s = math.inf
        self._not_before: list[Point] = []
        self._block_from = first[0]

    def at(self, tick: int) -> float:
        """Return the time of the tick with this number, in s."""
        return self._anchor[1] + self.slope_s * (tick - self._anchor[0])

    def see(self, latest: Point, *, cut: bool) -> None:
        """Add an upper bound of a tick's time.

        ``latest``: number of the newest tick in a read, and a time in s by which this tick had
        arrived. ``cut``: whether the tick's sample was incomplete in this read.
        """
        tick, arrival = latest
        anchor_tick, anchor_s = self._anchor
        if arrival < anchor_s + self.slope_s * (tick - anchor_tick):
            self._anchor = latest
        height_s = arrival - self.slope_s * tick
        if self._best is None or height_s < self._best_s:
            self._best, self._best_s = (latest, cut), height_s
        if tick - self._block_from >= BLOCK_TICKS:
            self._end_block(*self._best)
            self._best, self._not_before, self._block_from = None, [], tick

    def not_before(self, earliest: Point) -> None:
        """Add a lower bound of a tick's time.

        ``earliest``: number of the tick, and a time in s at which the tick had not yet arrived.
        """
        self._not_before.append(earliest)

    def _end_block(self, best: Point, cut: bool) -> None:
        if not self._latest or self._latest[-1][0][0] < best[0]:
            self._latest.append((best, cut))
        if len(self._not_before) >= FEWEST_READS:
            slope_s = self.slope_s
            heights = sorted(
                [(time - slope_s * tick, tick, time) for tick, time in self._not_before]
            )
            _, tick, time = heights[-1 - int(LATE_PART * len(heights))]
            earliest = tick, time - LATE_S
            is_near = 0.0 < self._height(best) - self._height(earliest) < WIDEST * self._period_s
            if is_near and (not self._earliest or self._earliest[-1][0] < tick):
                self._earliest.append(earliest)
        # A cut sample has not waited to be read, so it is the better upper bound.
        always_cut = all(was_cut for _, was_cut in self._latest)
        if always_cut or not (self._earliest and self._lay_between()):
            self._lay_under()

    def _height(self, point: Point) -> float:
        """Return the height of a point above a line through zero with the fitted slope, in s.

        It is the point's time, minus the fitted period times the number of the point's tick.
        """
        return point[1] - self.slope_s * point[0]

    def _within_skew(self, slope_s: float) -> float:
        least, most = self._period_s * (1 - LARGEST_SKEW), self._period_s * (1 + LARGEST_SKEW)
        return min(max(slope_s, least), most)

    def _lay_between(self) -> bool:
        """Place the fitted clock in the middle between all upper and lower bounds, and return True.

        If no straight line fits between them, forget the lower bounds and return False.
        """
        flattest, steepest = -math.inf, math.inf
        above = _hull([at for at, _ in self._latest])
        below = [(tick, -time) for tick, time in _hull([(t, -s) for t, s in self._earliest])]
        for latest in above:
            for earliest in below:
                if earliest[0] < latest[0]:
                    steepest = min(steepest, _slope(earliest, latest))
                elif earliest[0] > latest[0]:
                    flattest = max(flattest, _slope(latest, earliest))
        flattest, steepest = self._within_skew(flattest), self._within_skew(steepest)
        self.slope_s = (flattest + steepest) / 2
        low, high = max(map(self._height, below)), min(map(self._height, above))
        if flattest > steepest or low > high:
            self._earliest.clear()
            return False
        tick = self._latest[-1][0][0]
        self._anchor = tick, (low + high) / 2 + self.slope_s * tick
        return True

    def _lay_under(self) -> None:
        """Place the fitted clock under the latest points, along an edge of their lower convex hull.

        ``SUPPORT`` selects the edge.
        """
        cut = [at for at, was_cut in self._latest if was_cut]
        hull = _hull(cut or [at for at, _ in self._latest])
        middle = hull[0][0] + SUPPORT * (hull[-1][0] - hull[0][0])
        for before, after in pairwise(hull):
            if after[0] >= middle:
                self.slope_s = self._within_skew(_slope(before, after))
                break
        self._anchor = min(hull, key=self._height)


def _hull(points: list[Point]) -> list[Point]:
    """Return the lower convex hull of points that are sorted by tick."""
    hull: list[Point] = []
    for point in points:
        while len(hull) > 1 and _slope(hull[-2], point) <= _slope(hull[-2], hull[-1]):
            hull.pop()
        hull.append(point)
    return hull


def _slope(before: Point, after: Point) -> float:
    return (after[1] - before[1]) / (after[0] - before[0])
