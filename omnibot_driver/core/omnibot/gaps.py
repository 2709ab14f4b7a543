# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Where the line was idle, and how far that may be trusted.

A board sends a tick's frames at once, so a pause of its line stands between frames. An adapter that
collects bytes makes pauses of its own, anywhere, and so does a reader that is scheduled late
(``late_reads``). Which of the first two a pause is, only frames can tell: this module counts how
often pauses stood where they should. It knows places and times; not what is in a frame, nor which
frames are believed (``decoder``).
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

LATE_S: Final = 0.011
"""While the board runs its line is never idle for longer, unless bytes were lost; an adapter that
collects bytes for longer shows pauses of its own."""
BYTE_S: Final = 10 / 115200
"""To send one, by the manual."""
TICK_BYTES: Final = 14 + 9 + 15
"""All that one tick can bring. More at once after a pause means that we were late, not the line."""
PAUSES_TO_TRUST: Final = 16
"""Number of pauses in the expected places after which they are taken for the line's own."""

_FIRST: Final = attrgetter("first")


class InterFrameGaps:
    """``gaps``: those within the bytes held.

    ``sharp``: as a rule, the first byte that comes after a pause begins a frame; ``between``: as a
    rule, a frame begins somewhere in what comes after it. ``certain``: both have held for this time
    that once more changes nothing. ``at_pace``: the last bytes came without a pause.
    ``byte_s``: how long the line takes for a byte. ``collected``: the last read brought what had
    come for longer than a tick, so it ended anywhere in a tick, and hardly just behind the first
    byte of one.
    """

    def __init__(self, byte_s: float) -> None:
        self._byte_s = byte_s
        self.gaps: list[Gap] = []
        self.at_pace = self.collected = False
        self._reads: list[Read] = []
        self.doubt()

    def doubt(self) -> None:
        """Forget the pauses, which may have been misleading."""
        self.sharp = self.between = self.certain = False
        self._sharp = self._between = 0

    def read(self, pause_s: float, arrived: int, place: int, now: float) -> None:
        """Bytes arrived now, to be held from this place on, this time after the last."""
        idle_s = pause_s - arrived * self._byte_s
        self.at_pace = idle_s < PACE_S
        self.collected = pause_s > LATE_S and arrived <= 2 * TICK_BYTES
        if idle_s > GAP_S and arrived <= TICK_BYTES:
            self._add(pause_s, arrived, place)
        if self.gaps:
            self._reads.append(Read(place + arrived, now))

    def _add(self, pause_s: float, arrived: int, place: int) -> None:
        silent = pause_s >= IDLE_S
        sharp, between = self.sharp, self.between
        if pause_s > LATE_S:
            sharp = sharp or between or silent  # bytes were lost here, and hardly whole frames
            self._trust(sharp=False, between=False)
        width = 1 if sharp else arrived
        price = cost_model.KNOWN_GAP if between or silent else cost_model.GAP
        self.gaps.append(Gap(place, place + width, price, pause_s))

    def stood_between(self, pause_s: float, arrived: int) -> None:
        """Note that the bytes after this pause began and ended with a frame."""
        if self.stands_out(pause_s, arrived):
            self._trust(sharp=True, between=True)

    def stands_out(self, pause_s: float, arrived: int) -> bool:
        """Whether the line was idle before these bytes for longer than within any frame."""
        return pause_s - arrived * self._byte_s > GAP_S

    def compare(self, ends: Sequence[int]) -> None:
        """Do they end where frames begin? Then they are the line's, not the adapter's."""
        start = 0
        for end in ends:
            for gap in self.gaps:
                if start <= gap.first < end:
                    sharp = gap.first == start
                    self._trust(sharp=sharp, between=sharp or end < gap.before)
            start = end

    def against(self, data: bytes | bytearray, start: int, end: int) -> float:
        """The cost of the pauses within these bytes, if they are taken for a frame."""
        return sum(
            gap.price
            for gap in self._within(start, end)
            if self._cause(gap, data, start, end) is not Cause.LATE_READER
        )

    def undecided(self, data: bytes | bytearray, start: int, end: int) -> bool:
        """Whether later bytes may still explain the pause within this frame."""
        causes = [self._cause(gap, data, start, end) for gap in self._within(start, end)]
        return Cause.UNDECIDED in causes and Cause.IDLE_LINE not in causes

    def silent_within(self, start: int, end: int) -> bool:
        """Whether there was a long pause of reading within these bytes."""
        return any(start < gap.first < end and gap.pause_s >= IDLE_S for gap in self.gaps)

    def in_its_tick(self, start: int) -> bool:
        """Whether these bytes began after a pause, and so lately that the next tick has not."""
        for gap in self.gaps:
            if gap.first == start and gap.pause_s <= LATE_S:
                came = next(read.now for read in self._reads if read.end > start)
                return self._reads[-1].now - came < HALF_TICK_S
        return False

    def forget(self, count: int) -> None:
        """Forget the pauses of the first bytes, which have been decoded."""
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
        """Time tells nothing about the bytes held."""
        self.gaps, self._reads = [], []

    def _within(self, start: int, end: int) -> Iterator[Gap]:
        """The pauses between the first and the last of these bytes."""
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
