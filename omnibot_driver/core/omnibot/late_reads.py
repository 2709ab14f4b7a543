# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Was the line idle, or was the reader late?

A read is not an arrival: it returns when the reader is scheduled, and brings what the adapter has
handed over by then. So a pause between two reads says little about the line. The board's clock
says more: it sends an IMU frame with every tick. Where a pause within a frame stands for lost
bytes, that frame and all that follow are late by whole ticks, for good. A late reader catches up.

This module knows lengths, ticks and times; not what is in a frame, nor which one is believed.
"""

from bisect import bisect_right
from enum import Enum
from itertools import pairwise
from math import remainder
from operator import attrgetter
from typing import Final, NamedTuple

from omnibot_driver.core.omnibot.frames import (
    IMU_LENGTH,
    INCOMPLETE,
    NO_FRAME,
    is_text,
    length_begun,
    measure,
)
from omnibot_driver.core.omnibot.schedule import TICK_S

IDLE_S: Final = 0.1
"""Longer than any adapter keeps a byte back (16 ms), and ten times the board's 10 ms tick."""
HALF_TICK_S: Final = TICK_S / 2
"""A frame that is late by less has not missed its tick."""
GAP_S: Final = 4e-3
"""No frame is sent with such a pause in it."""
NEAR_S: Final = 2e-3
"""Lost bytes make a board's frames late by whole ticks, within this tolerance."""
INTO_TICK_S: Final = 1e-3
"""Delay of what follows an IMU frame in its tick, and its tolerance."""
PUNCTUAL_S: Final = 1e-3
"""The delays of a punctual reader differ by less, also those of a USB adapter."""
PACE_S: Final = 2e-4
"""Bytes that come at the pace of the line are early or late by less."""
FEW_BYTES: Final = 2
"""Too few to tell the pace."""
TICKS_TO_PROVE: Final = 2
"""Behind a pause, each read by itself and all equally late."""
MOST_BYTES: Final = 6 * IMU_LENGTH
"""Behind a frame with a pause in it; then it is decided."""


class Cause(Enum):
    """The causes of a pause between two reads."""

    LATE_READER = "late reader"
    UNDECIDED = "undecided"
    IDLE_LINE = "idle line"


class Read(NamedTuple):
    """The bytes before ``end`` had been read at ``now``."""

    end: int
    now: float


_END: Final = attrgetter("end")


class Gap(NamedTuple):
    """Somewhere from ``first`` on, and before ``before``, the line was idle, or the reader late.

    ``price``: of a frame around it, if the line was idle; ``pause_s``: since the read before it.
    """

    first: int
    before: int
    price: float
    pause_s: float


def cause(
    gap: Gap, reads: list[Read], data: bytes | bytearray, start: int, end: int, byte_s: float
) -> Cause:
    """Why there was a pause within these bytes, if they are a frame.

    ``reads``: all since the gap, with the one that ended it. The reader was late

    * when anything that follows is in time again, unless all of it came at the pace of the line:
      then the reader was prompt, and the frame begins in the middle of another;
    * when bytes came faster than the line can send them: they had waited.

    The line was idle when a text stands behind the pause, when the bytes that follow the frame
    begin none, or when ticks that were read one by one are equally late. While a board is paused
    nothing is due.
    """
    if is_text(data, start):
        return Cause.LATE_READER
    if is_text(data, gap.first) and measure(data, gap.first) > 0:
        return Cause.IDLE_LINE
    size, rest_end, tick, ticks = len(data), end, start, 0
    first: Read | None = None
    on_time_s = latest_s = steady_s = 0.0
    to_prove = 1 if gap.pause_s >= IDLE_S else TICKS_TO_PROVE
    proofs, proved, paced = 0, -1, False
    for read_end, now in reads[bisect_right(reads, gap.first, key=_END) :]:
        while end < read_end:
            if end >= size:
                return Cause.UNDECIDED
            if measure(data, end) == NO_FRAME:
                return Cause.IDLE_LINE
            if is_text(data, end):
                return Cause.LATE_READER
            if end + 1 == size:
                return Cause.UNDECIDED
            length = length_begun(data, end)
            if length == IMU_LENGTH:
                tick, ticks = end, ticks + 1
            end += length
        late_s = now - ticks * TICK_S - (read_end - tick) * byte_s
        if first is None:
            first = Read(read_end, now)
            on_time_s = now - gap.pause_s - (gap.first - start) * byte_s
            latest_s = on_time_s + HALF_TICK_S
            if rest_end - start != IMU_LENGTH:
                on_time_s -= INTO_TICK_S
        waited_s = (read_end - first.end) * byte_s - (now - first.now)
        at_pace = abs(waited_s) < PACE_S
        if first.end + FEW_BYTES < read_end <= rest_end:
            paced = at_pace
        if late_s < latest_s:
            if paced and at_pace:
                return _by_the_next_frame(reads, first, data, rest_end, byte_s)
            return Cause.LATE_READER
        if waited_s > PUNCTUAL_S or read_end > rest_end + MOST_BYTES:
            return Cause.LATE_READER
        if abs(remainder(late_s - on_time_s, TICK_S)) > NEAR_S:
            proved = -1
        elif proved < 0 or abs(late_s - steady_s) > PUNCTUAL_S:
            steady_s, proofs, proved = late_s, 0, ticks
        elif ticks > proved:
            proofs, proved = proofs + 1, ticks
            if proofs == to_prove:
                return Cause.IDLE_LINE
    return Cause.UNDECIDED


def _by_the_next_frame(
    reads: list[Read], first: Read, data: bytes | bytearray, start: int, byte_s: float
) -> Cause:
    """Whether it is in one piece, as a tick's frame is, or parted by the pause of a whole tick.

    ``first``: the read that ended the pause; ``start``: where that frame begins.
    """
    length = measure(data, start) if start < len(data) else INCOMPLETE
    if length <= 0:
        return Cause.UNDECIDED if length == INCOMPLETE else Cause.IDLE_LINE
    end = start + length
    for before, after in pairwise(reads):
        pause_s = after.now - before.now - (after.end - before.end) * byte_s
        if start < before.end < end and pause_s > GAP_S:
            ticks_s = after.now - first.now
            punctual = abs(remainder(ticks_s, TICK_S)) < PACE_S
            return Cause.IDLE_LINE if punctual else Cause.LATE_READER
    return Cause.LATE_READER
