# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The pauses in which the line was idle, and whether they show where frames begin.

A *pause* is a time in which no bytes are read; it is not the board's paused mode. A pause has one
of three causes:

* The board sends nothing. This happens only between frames.
* An adapter collects bytes.
* The computer reads late (``late_reads``).

The decoder tells this module where the accepted frames end. This shows whether the pauses on this
line are only between frames.

This module knows positions of bytes, and times; it does not know what a frame contains.
"""

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from operator import attrgetter
from typing import Final

from omnibot_driver.core.omnibot import cost_model
from omnibot_driver.core.omnibot.late_reads import (
    GAP_S,
    HALF_TICK_S,
    IDLE_S,
    PACE_S,
    Cause,
    Gap,
    Read,
    cause,
)

NORMAL_PAUSE_S: Final = 0.011
"""Longest normal pause in s between two reads: about one tick.

A longer pause shows lost bytes, an adapter that collects bytes, or a late read.
"""
BYTE_S: Final = 10 / 115200
"""Time in s to send one byte at the default 115200 baud."""
TICK_BYTES: Final = 14 + 9 + 15
"""Largest number of bytes that the board sends in one tick (10 ms). If more bytes come in a read
after a pause, the read was late."""
PAUSES_TO_TRUST: Final = 16
"""Number of pauses between frames after which the driver trusts that the board makes these pauses.

After fewer pauses, an adapter may still be their cause.
"""

_FIRST: Final = attrgetter("first")


class InterFrameGaps:
    """The pauses within the bytes that the decoder holds, and what is known of this line's pauses.

    * ``byte_s``: time in s that the line takes for a byte.
    * ``between``: whether pauses are normally between frames. A frame then begins in the read after
      a pause.
    * ``sharp``: whether a frame normally begins at the first byte of the read after a pause.
    * ``certain``: whether enough pauses have confirmed ``sharp`` and ``between``. After that,
      further confirmations are not counted.
    * ``at_pace``: whether the line was busy for the whole time between the last two reads.
    * ``collected``: whether an adapter collected the bytes of the last read for more than a tick.
    """

    def __init__(self, byte_s: float) -> None:
        self._byte_s = byte_s
        self.gaps: list[Gap] = []
        self.at_pace = self.collected = False
        self._reads: list[Read] = []
        self.doubt()

    def doubt(self) -> None:
        """Stop assuming that pauses are between frames.

        The pauses between reads may have another cause than an idle line.
        """
        self.sharp = self.between = self.certain = False
        self._sharp = self._between = 0

    def read(self, pause_s: float, arrived: int, place: int, now: float) -> None:
        """Record a read of ``arrived`` bytes, and a pause if the line was idle before these bytes.

        ``pause_s``: time in s since the previous read. ``place``: position of the first new byte
        among the held bytes.
        """
        idle_s = pause_s - arrived * self._byte_s
        self.at_pace = idle_s < PACE_S
        self.collected = pause_s > NORMAL_PAUSE_S and arrived <= 2 * TICK_BYTES
        if idle_s > GAP_S and arrived <= TICK_BYTES:
            self._add(pause_s, arrived, place)
        if self.gaps:
            self._reads.append(Read(place + arrived, now))

    def _add(self, pause_s: float, arrived: int, place: int) -> None:
        silent = pause_s >= IDLE_S
        sharp, between = self.sharp, self.between
        if pause_s > NORMAL_PAUSE_S:
            # Such a long pause shows lost bytes. It is unlikely that only whole frames were lost.
            sharp = sharp or between or silent
            self._trust(sharp=False, between=False)
        width = 1 if sharp else arrived
        price = cost_model.KNOWN_GAP if between or silent else cost_model.GAP
        self.gaps.append(Gap(place, place + width, price, pause_s))

    def stood_between(self, pause_s: float, arrived: int) -> None:
        """Record a read that begins with a frame: a pause before this read was between frames.

        ``pause_s``: time in s since the previous read. ``arrived``: number of bytes in the read.
        """
        if self.stands_out(pause_s, arrived):
            self._trust(sharp=True, between=True)

    def stands_out(self, pause_s: float, arrived: int) -> bool:
        """Return whether the line was idle for longer than ``GAP_S`` before these bytes.

        ``pause_s``: time since the previous read. ``arrived``: number of bytes.
        """
        return pause_s - arrived * self._byte_s > GAP_S

    def compare(self, ends: Sequence[int]) -> None:
        """Learn from accepted frames whether the line pauses between frames or within frames.

        ``ends``: the end of each accepted frame, as a position among the bytes that the decoder
        holds.
        """
        start = 0
        for end in ends:
            for gap in self.gaps:
                if start <= gap.first < end:
                    sharp = gap.first == start
                    self._trust(sharp=sharp, between=sharp or end < gap.before)
            start = end

    def against(self, data: bytes | bytearray, start: int, end: int) -> float:
        """Return the cost of assuming that ``data[start:end]`` is a frame with pauses in it."""
        return sum(
            gap.price
            for gap in self._within(start, end)
            if self._cause(gap, data, start, end) is not Cause.LATE_READER
        )

    def undecided(self, data: bytes | bytearray, start: int, end: int) -> bool:
        """Return whether only later bytes can show the cause of a pause in a supposed frame.

        ``data[start:end]``: the supposed frame. If a pause in it certainly comes from an idle line,
        the result is False.
        """
        causes = [self._cause(gap, data, start, end) for gap in self._within(start, end)]
        return Cause.UNDECIDED in causes and Cause.IDLE_LINE not in causes

    def silent_within(self, start: int, end: int) -> bool:
        """Return whether a pause of ``IDLE_S`` or more lies between these positions of bytes."""
        return any(start < gap.first < end and gap.pause_s >= IDLE_S for gap in self.gaps)

    def in_its_tick(self, start: int) -> bool:
        """Return whether the bytes from ``start`` on came quickly, and after a short pause.

        All of these bytes must have come within half a tick, directly after a pause of at most
        ``NORMAL_PAUSE_S``.
        """
        for gap in self.gaps:
            if gap.first == start and gap.pause_s <= NORMAL_PAUSE_S:
                came = next(read.now for read in self._reads if read.end > start)
                return self._reads[-1].now - came < HALF_TICK_S
        return False

    def forget(self, count: int) -> None:
        """Forget the pauses in the first ``count`` bytes, because the decoder has dropped them."""
        if not self.gaps or self.gaps[-1].first < count:
            self.clear()
            return
        self.gaps = [
            gap._replace(first=gap.first - count, before=gap.before - count)
            for gap in self.gaps
            if gap.first >= count
        ]
        first = self.gaps[0].first + count
        self._reads = [Read(end - count, now) for end, now in self._reads if end > first]

    def clear(self) -> None:
        """Forget the times of all reads, and all pauses in the bytes that the decoder holds."""
        self.gaps, self._reads = [], []

    def _within(self, start: int, end: int) -> Iterator[Gap]:
        """Yield the pauses that lie entirely between the positions ``start`` and ``end``."""
        gaps = self.gaps
        for number in range(bisect_right(gaps, start, key=_FIRST), len(gaps)):
            if gaps[number].first >= end:
                return
            if gaps[number].before <= end:
                yield gaps[number]

    def _cause(self, gap: Gap, data: bytes | bytearray, start: int, end: int) -> Cause:
        return cause(gap, self._reads, data, start, end, self._byte_s)

    def _trust(self, *, sharp: bool, between: bool) -> None:
        if sharp and between and self.certain:
            return
        most = 2 * PAUSES_TO_TRUST
        self._sharp = min(self._sharp + 1, most) if sharp else max(self._sharp - 4, 0)
        self._between = min(self._between + 1, most) if between else max(self._between - 4, 0)
        self.sharp = self._sharp >= PAUSES_TO_TRUST
        self.between = self._between >= PAUSES_TO_TRUST
        self.certain = self._sharp == self._between == most
