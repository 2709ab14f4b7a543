# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Computes sampling times, by the host's clock, from arrival times.

The board's ticks are counted. ``ClockFit``, the *fitted clock*, converts a tick's number to a time.
One constant error remains: the smallest delay that ever occurs. docs/internals/time.md explains
why.

This module knows readings and times; it reads no clock and does not know any board's bytes.
"""

import math
from collections import deque
from collections.abc import Sequence
from typing import Final

from omnibot_driver.core.readings import (
    DisplacementReading,
    ImuReading,
    PoseReading,
    Reading,
    SampleBoundary,
)
from omnibot_driver.core.timing.clock_fit import ClockFit, Point

LARGEST_LOSS_TICKS: Final = 25
"""Largest number of missing ticks that is corrected by arrival times.

If more ticks are missing, the clock is restarted.
"""
BEAT_READS: Final = 12
"""Number of consecutive reads that certainly include a read with little delay. An adapter with a
timer of 16 ms reads at five phases of a 10 ms tick; 12 reads contain each phase twice."""
CALM: Final = 0.45
"""Limit of the fast path (``DeviceClock.stamp``): largest distance, in periods, of the last two
reads from the fitted clock. Keep the value below 0.5: half-way between two ticks, a read's tick is
uncertain."""
LARGEST_RISE: Final = 0.02
"""Fraction by which the step from one stamp to the next may exceed the period.

A new fit can shift the fitted clock to later times. With this limit, the stamps follow slowly.
"""
SMALLEST_STEP_S: Final = 1e-6
"""Smallest step in s between two stamps, used if the arrival times do not allow a larger step."""


class DeviceClock:
    """Stamps readings with their sampling times, which it estimates from arrival times.

    In each tick, the board sends one ImuReading. ``period_s``: nominal period of the ticks, in s.
    """

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._calm_s = CALM * period_s
        self._longest_loss_s = LARGEST_LOSS_TICKS * period_s
        self._tick = 0
        self._stamp_s = -math.inf
        self.restart()

    def restart(self) -> None:
        """Forget all ticks, because their relation to the board's next ticks is unknown.

        The stamps continue to increase.
        """
        self._stamped_tick: int | None = None
        self._displaced_tick: int | None = None
        self._displacement_ticks = 0
        self._line: ClockFit | None = None
        self._seen_tick: int | None = None
        self._settled = False
        self._calm: ClockFit | None = None
        """The fitted clock if the fast path may be used; None if not.

        The fast path needs ``BEAT_READS`` earlier reads, and a last read that ended on time with a
        complete sample.
        """
        self._single_reads = 0
        """How many reads in a row, up to the last one, brought exactly one sample."""
        self._lags_s: deque[float] = deque(maxlen=BEAT_READS)
        self._seen_at = -math.inf
        """Time in s of the last read that brought a new tick. If the next new tick is read less
        than half a period later, the last read was late."""
        self._awaited: Point | None = None
        """Number of the next tick, and the earliest time in s at which this tick's sample can be
        complete."""
        self._cut_off: Point | None = None
        """Tick number of the sample that the last read cut off, and the earliest time in s at which
        this sample can be complete. None if no sample was cut off."""

    @property
    def skew_ppm(self) -> float:
        """How much faster the board's clock is than the host's, in ppm, by the fitted clock."""
        line = self._line
        return 0.0 if line is None else 1e6 * (self._period_s / line.slope_s - 1.0)

    def stamps(
        self, readings: Sequence[Reading], now: float, edge: SampleBoundary | None
    ) -> list[float]:
        """Return the sampling time in s of each reading; for a displacement, that of its tick.

        Stamps increase from tick to tick, exceeding the read time ``now`` by microseconds at most.
        ``edge``: the read's end; None if unknown.
        """
        if self._stamped_tick is None and now - self._seen_at > self._longest_loss_s:
            self.restart()  # only a part of a sample has arrived, long ago
        ticks = self._count(readings)
        if ticks and ticks.count(ticks[0]) == len(ticks) and isinstance(readings[0], ImuReading):
            stamp_s = self._due(ticks[0], now, edge, len(ticks))
            if stamp_s is not None:
                return [stamp_s] * len(ticks)
        if not readings and (edge is None or not edge.ahead):
            return []  # bytes outside samples do not show the time of the next sample
        line = self._line = self._line or ClockFit(self._period_s, (self._tick, now))
        if readings and self._cut_off:
            if isinstance(readings[0], ImuReading) and not readings[0].lost:
                line.not_before(self._cut_off)
            self._cut_off = None
        short = 0
        if edge is not None:
            kinds = list(map(type, readings))
            came = edge.ahead + kinds.count(ImuReading)
            if came:
                self._single_reads = self._single_reads + 1 if came == 1 else 0
                short = self._compare(line, edge, now, counted=DisplacementReading in kinds)
        # If a displacement's counter has lowered the tick number, the stamps must still increase.
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

    def stamp(self, reading: ImuReading, now: float, edge: SampleBoundary | None) -> float | None:
        """Return the stamp in s of one reading that came alone and on time, else None.

        This is the fast path. If the result is None, nothing has changed, and the caller must call
        ``stamps``.
        """
        if reading.lost:
            return None
        stamp_s = self._due(self._tick + 1, now, edge, 1)
        if stamp_s is not None:
            self._tick += 1
        return stamp_s

    def _due(
        self, tick: int, now: float, edge: SampleBoundary | None, readings: int
    ) -> float | None:
        """Return the stamp in s of a new tick; None if its sample is incomplete or not on time."""
        line = self._calm
        if line is None or edge is None or edge.ahead or edge.cut or tick == self._seen_tick:
            return None
        arrival = now + edge.latest_s
        lag_s = arrival - line.at(tick)
        if not -self._calm_s <= lag_s <= self._calm_s:
            return None
        self._single_reads += 1
        self._see(line, tick, lag_s, now)
        line.see((tick, arrival), cut=False)
        self._awaited = tick + 1, now + edge.earliest_s
        self._stamp(tick, now, (now - self._stamp_s) / (readings + 1))
        return self._stamp_s

    def _count(self, readings: Sequence[Reading]) -> list[int]:
        """Return the tick number of each reading.

        Lost readings are counted, too. The board's own counter in a displacement corrects the tick
        number.
        """
        ticks: list[int] = []
        for reading in readings:
            if isinstance(reading, ImuReading):
                self._tick += 1 + reading.lost
            elif isinstance(reading, DisplacementReading):
                self._tick += self._missing(reading)
                self._displaced_tick = None if reading.restarted else self._tick
            elif isinstance(reading, PoseReading) and self._displaced_tick is not None:
                self._displaced_tick += reading.lost * self._displacement_ticks
            ticks.append(self._tick)
        return ticks

    def _missing(self, reading: DisplacementReading) -> int:
        """Return how many ticks to add to the tick number, as a displacement's counter shows.

        The result is negative if the tick number is too high, and 0 if no earlier displacement is
        known, or this one has no duration.
        """
        if self._displaced_tick is None or reading.duration_s is None:
            return 0
        self._displacement_ticks = round(reading.duration_s / self._period_s)
        passed = self._displacement_ticks * (reading.lost + 1)
        return self._displaced_tick + passed - self._tick

    def _compare(self, line: ClockFit, edge: SampleBoundary, now: float, *, counted: bool) -> int:
        """Compare the newest arrival with the fitted clock, and correct the tick count.

        Return the correction in ticks, positive after lost ticks. ``counted``: whether this read
        contains a displacement. If so, the displacement's tick number is corrected, too.
        """
        tick, arrival = self._tick + edge.ahead, now + edge.latest_s
        if tick == self._seen_tick:
            return 0  # an earlier read brought the tick's first bytes
        lag_s = arrival - line.at(tick)
        period_s, lags_s = self._period_s, self._lags_s
        short = 0
        if self._settled and lag_s < -period_s / 2:
            short = round(lag_s / period_s)
        elif len(lags_s) == BEAT_READS:
            self._settled = True
            *before_s, last_s = lags_s
            at_once_s = lag_s - max(lags_s)
            later_s = min(last_s, lag_s) - max(before_s)
            if (
                self._single_reads > BEAT_READS
                and now - self._seen_at > period_s / 2
                and (0.95 < at_once_s / period_s < 1.05 or 0.95 < later_s / period_s < 1.5)
            ):
                short = 1  # a larger jump is more likely a delay than a loss
            elif min(lags_s) > period_s / 2:
                # All recent arrivals are late: the last displacement came after the lost ticks.
                short, counted = round(min(lags_s) / period_s), True
                lags_s.clear()
        if short > LARGEST_LOSS_TICKS:
            self.restart()
            line = self._line = ClockFit(period_s, (tick, arrival))
            short, lag_s = 0, 0.0
        elif short:
            self._tick += short
            if self._displaced_tick is not None:
                self._displaced_tick = min(self._displaced_tick + short * counted, self._tick)
            tick += short
            lag_s -= short * line.slope_s
        self._see(line, tick, lag_s, now)
        line.see((tick, arrival), cut=edge.cut)
        if edge.cut:
            self._cut_off = tick, now + edge.earliest_s
        else:
            self._awaited = tick + 1, now + edge.earliest_s
        is_calm = self._settled and not edge.cut and abs(lag_s) <= self._calm_s
        self._calm = line if is_calm else None
        return short

    def _see(self, line: ClockFit, tick: int, lag_s: float, now: float) -> None:
        """Record the delay of a new tick, and the time ``now`` at which the tick was read.

        ``lag_s``: arrival minus the time by the fitted clock. If the previous tick was read late,
        the delay of the previous tick is dropped.
        """
        if now - self._seen_at < self._period_s / 2 and self._lags_s:
            self._lags_s[-1] = lag_s
            self._single_reads = 0
        else:
            self._lags_s.append(lag_s)
            if self._awaited:
                line.not_before(self._awaited)
        self._awaited = None
        self._seen_tick, self._seen_at = tick, now

    def _stamp(self, tick: int, latest_s: float, room_s: float) -> None:
        """Set a tick's stamp by the fitted clock, but limit the step from the last stamp.

        ``latest_s``: latest allowed stamp, in s. ``room_s``: step in s that spreads this read's
        remaining stamps evenly.
        """
        assert self._line is not None
        stamp_s = min(self._line.at(tick), latest_s)
        if self._stamped_tick is not None:
            passed = max(1, tick - self._stamped_tick)
            stamp_s = min(stamp_s, self._stamp_s + passed * self._period_s * (1 + LARGEST_RISE))
        step_s = max(SMALLEST_STEP_S, min(self._period_s / 2, room_s))
        self._stamp_s = max(stamp_s, self._stamp_s + step_s)
        self._stamped_tick = tick
