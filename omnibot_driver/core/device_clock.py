"""From arrival times to sampling times: the board's clock, as it is seen from the host's.

The board samples once a tick by a crystal of its own. Its bytes reach us with a delay that is
unknown and ever changing, but never before they were sent. Two questions follow.

*Which tick is it?* IMU readings are counted, with those that the board says were lost. What no byte
told of is told exactly by the counter that displacements carry; until the next of those, or without
any, by arrival: a read takes all that has come, so the newest tick in it is hardly older than one
period, and never from the future.

*When was it?* Drawn over their ticks, arrivals lie on or above a straight line whose slope is the
true period. The least delayed arrival of every second is kept, and the line is laid under those of
the last while as close as it goes: it is an edge of their lower convex hull. An arrival below the
line moves it at once. Bursts, stalls and losses only make points above the line. What stays in the
stamps is the least delay that ever happens: one constant. A sample that was cut by its read has not
waited at all, so if there are such points the line is laid under them alone: what waits for a
timer may for seconds keep that timer's pace.

This module knows readings and times. It reads no clock and knows no board's bytes.
"""

import math
from collections import deque
from collections.abc import Sequence
from itertools import pairwise
from typing import Final

from omnibot_driver.core.board import DisplacementReading, ImuReading, PoseReading, Reading

BLOCK_TICKS: Final = 100
"""The least delayed arrival of so many ticks is kept: of one second."""
BLOCKS_KEPT: Final = 75
"""An adapter's timer and the board's tick beat against each other, within 100 ppm, every 20 s."""
LARGEST_SKEW: Final = 1.2e-4
"""Of the board's crystal against the host's: 100 ppm, and a little."""
SUPPORT: Final = 0.75
"""The line touches the points on both sides of this part of their span: late enough to follow what
has lately been found out, early enough not to follow the last second's jitter."""
LARGEST_LOSS_TICKS: Final = 25
"""If more are missing that no counter has told, then nothing that was known holds any more."""
BEAT_READS: Final = 12
"""Among so many reads one is little delayed: a 16 ms adapter's cuts recur after five."""
LARGEST_RISE: Final = 0.02
"""By this part of a period a stamp follows, each tick, a line that was laid later."""
SMALLEST_STEP_S: Final = 1e-6
"""Between two stamps for which even their arrivals leave no room."""

Point = tuple[int, float, bool]
"""A tick, the time of its arrival, and whether a read cut it: the rest had not arrived yet."""


class DeviceClock:
    """``period_s``: the board's nominal tick; each brings one ImuReading."""

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._tick = 0
        self._stamp_s = -math.inf
        self.restart()

    def restart(self) -> None:
        """What the board does from here on has nothing to do with what it did before.

        Stamps go forward all the same.
        """
        self._stamped_tick: int | None = None
        self._displaced_tick: int | None = None
        self._displacement_ticks = 0
        self._anchor: Point | None = None
        self._slope_s = self._period_s
        self._points: deque[Point] = deque(maxlen=BLOCKS_KEPT)
        self._best: Point | None = None
        self._block_from = self._tick
        self._seen_tick: int | None = None
        self._settled = False
        self._lags_s: deque[float] = deque(maxlen=BEAT_READS)

    @property
    def skew_ppm(self) -> float:
        """By how much the board's clock is faster than ours, by what has been seen so far."""
        return 1e6 * (self._period_s / self._slope_s - 1.0)

    def stamps(
        self, readings: Sequence[Reading], now: float, newest: tuple[int, float] | None = (0, 0.0)
    ) -> list[float]:
        """When each of these readings, all that one read at ``now`` completed, was sampled.

        ``newest``: see ``Board``. From tick to tick stamps increase, and none is later than
        ``now``; a displacement has the stamp of its tick's ImuReading.
        """
        ticks = self._count(readings)
        if self._anchor is None:
            self._anchor = (self._tick, now, False)
        short = 0
        if newest is not None:
            ahead, missing_s = newest
            kinds = [type(reading) for reading in readings]
            came = ahead + kinds.count(ImuReading)
            if came:
                point = (self._tick + ahead, now + missing_s, missing_s > 0.0)
                short = self._compare(point, alone=came == 1, counted=DisplacementReading in kinds)
        # Where a counter took ticks back, the order of the readings must still find room.
        least_s = 0.0 if len(ticks) < 2 or ticks == sorted(ticks) else SMALLEST_STEP_S
        stamps = []
        for left, tick, reading in zip(range(len(ticks), 0, -1), ticks, readings, strict=True):
            is_new = tick + short != self._stamped_tick
            kind = type(reading)
            if kind is ImuReading or (kind is DisplacementReading and is_new):
                later_s = max((ticks[-1] - tick) * self._period_s, left * least_s)
                self._stamp(tick + short, now - later_s, (now - self._stamp_s) / (left + 1))
            stamps.append(self._stamp_s)
        return stamps

    def _count(self, readings: Sequence[Reading]) -> list[int]:
        """The ticks of the readings, by what is known of losses; the counter is right."""
        ticks: list[int] = []
        for reading in readings:
            if isinstance(reading, ImuReading):
                self._tick += 1 + reading.lost
            elif isinstance(reading, DisplacementReading):
                self._tick += self._missing(reading)
                self._displaced_tick = self._tick
            elif isinstance(reading, PoseReading) and self._displaced_tick is not None:
                self._displaced_tick += reading.lost * self._displacement_ticks
            ticks.append(self._tick)
        return ticks

    def _missing(self, reading: DisplacementReading) -> int:
        """How many ticks the counter is ahead of the count."""
        if self._displaced_tick is None or reading.duration_s is None:
            return 0
        self._displacement_ticks = round(reading.duration_s / self._period_s)
        passed = self._displacement_ticks * (reading.lost + 1)
        return self._displaced_tick + passed - self._tick

    def _compare(self, point: Point, *, alone: bool, counted: bool) -> int:
        """Hold the newest tick against its arrival; by how many the count was found to be short.

        ``alone``: the read brought no other sample, so it was not late; ``counted``: a counter told
        this tick.
        """
        tick, arrival, cut = point
        if tick == self._seen_tick:
            return 0  # its beginning has been seen before, and told more
        lag_s = arrival - self._line(tick)
        period_s, lags_s = self._period_s, self._lags_s
        short = 0
        if self._settled and lag_s < -period_s / 2:
            short = round(lag_s / period_s)
        elif len(lags_s) == BEAT_READS:
            self._settled = True
            if alone and lag_s > min(max(lags_s), period_s / 2) + 0.95 * period_s:
                short = max(1, math.floor(lag_s / period_s))
            elif min(lags_s) > period_s / 2:
                short, counted = round(min(lags_s) / period_s), True
                lags_s.clear()
        if short > LARGEST_LOSS_TICKS:
            self.restart()
            self._anchor = point
            return self._compare(point, alone=alone, counted=counted)
        if short:
            self._tick += short
            if counted and self._displaced_tick is not None:
                self._displaced_tick += short
            tick += short
            lag_s -= short * self._slope_s
        lags_s.append(lag_s)
        self._learn((tick, arrival, cut), lag_s)
        self._seen_tick = tick
        return short

    def _learn(self, point: Point, lag_s: float) -> None:
        """Keep the least delayed arrival of each block."""
        tick, arrival, _ = point
        if lag_s < 0.0:
            self._anchor = point
        best = self._best
        if best is None or arrival < best[1] + self._slope_s * (tick - best[0]):
            self._best = point
        if tick - self._block_from >= BLOCK_TICKS:
            assert self._best is not None
            if not self._points or self._points[-1][0] < self._best[0]:
                self._points.append(self._best)
            self._lay_line()
            self._best, self._block_from = None, tick

    def _line(self, tick: int) -> float:
        assert self._anchor is not None
        return self._anchor[1] + self._slope_s * (tick - self._anchor[0])

    def _lay_line(self) -> None:
        """Under all points, as high as it goes over their middle, within the crystals' skew."""
        hull: list[Point] = []
        for point in [point for point in self._points if point[2]] or self._points:
            while len(hull) > 1 and _slope(hull[-2], point) <= _slope(hull[-2], hull[-1]):
                hull.pop()
            hull.append(point)
        middle = hull[0][0] + SUPPORT * (hull[-1][0] - hull[0][0])
        for before, after in pairwise(hull):
            if after[0] >= middle:
                skew = _slope(before, after) / self._period_s - 1.0
                skew = min(max(skew, -LARGEST_SKEW), LARGEST_SKEW)
                self._slope_s = self._period_s * (1.0 + skew)
                break
        self._anchor = min(hull, key=lambda point: point[1] - self._slope_s * point[0])

    def _stamp(self, tick: int, latest_s: float, room_s: float) -> None:
        """The line's time, but no jump backwards, and forwards only little by little.

        ``room_s``: by so much it may go forward and leave as much to each that comes after it.
        """
        stamp_s = min(self._line(tick), latest_s)
        if self._stamped_tick is not None:
            passed = max(1, tick - self._stamped_tick)
            stamp_s = min(stamp_s, self._stamp_s + passed * self._period_s * (1 + LARGEST_RISE))
        step_s = max(SMALLEST_STEP_S, min(self._period_s / 2, room_s))
        self._stamp_s = max(stamp_s, self._stamp_s + step_s)
        self._stamped_tick = tick


def _slope(before: Point, after: Point) -> float:
    return (after[1] - before[1]) / (after[0] - before[0])
