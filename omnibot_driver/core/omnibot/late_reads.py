# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The cause of a pause between two reads: an idle line, or a late reader.

A read does not return when bytes arrive. It returns when the reader is scheduled, with the bytes
that the adapter has delivered by then. So a pause between two reads proves little about the line.
The board's clock proves more: the board sends an IMU frame in every tick. If bytes were lost in a
pause within a frame, that frame and all that follow stay late by whole ticks. A late reader catches
up.

This module knows lengths, ticks and times; it does not know what a frame contains, nor which frame
is accepted.
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
"""Pause in s that exceeds what any adapter causes (16 ms), and is ten of the board's ticks."""
HALF_TICK_S: Final = TICK_S / 2
"""Delay in s below which a frame has not missed its tick."""
GAP_S: Final = 4e-3
"""Pause in s that never occurs within a frame as the board sends it."""
NEAR_S: Final = 2e-3
"""Tolerance in s for delays by whole ticks, which lost bytes cause."""
INTO_TICK_S: Final = 1e-3
"""Delay in s of a frame that follows the IMU frame in its tick; the tolerance is as large."""
PUNCTUAL_S: Final = 1e-3
"""Limit in s of the differences between a punctual reader's delays, even with a USB adapter."""
PACE_S: Final = 2e-4
"""Largest deviation in s of bytes that arrive at the pace of the line."""
FEW_BYTES: Final = 2
"""Number of bytes that are too few to measure the pace."""
TICKS_TO_PROVE: Final = 2
"""Number of further ticks, read one by one and equally late, that prove lost bytes."""
MOST_BYTES: Final = 6 * IMU_LENGTH
"""Number of bytes after a frame with a pause in it at which its cause is decided."""


class Cause(Enum):
    """The causes of a pause between two reads."""

    LATE_READER = "late reader"
    UNDECIDED = "undecided"
    IDLE_LINE = "idle line"


class Read(NamedTuple):
    """A read: at ``now`` in s, the held bytes before position ``end`` had been read."""

    end: int
    now: float


_END: Final = attrgetter("end")


class Gap(NamedTuple):
    """A pause right before a byte whose position is at least ``first`` and less than ``before``.

    There the line was idle, or the reader was late. ``price``: cost of a frame around the pause if
    the line was idle; ``pause_s``: time in s since the read before it.
    """

    first: int
    before: int
    price: float
    pause_s: float


def cause(
    gap: Gap, reads: list[Read], data: bytes | bytearray, start: int, end: int, byte_s: float
) -> Cause:
    """Return the cause of a pause between ``start`` and ``end``, if these bytes are a frame.

    ``reads``: all reads since the pause, from the one that ended it. The reader was late

    * if anything that follows is on time again. If all of it came at the pace of the line, the
      reader may have been prompt and the frame may begin in the middle of another: then the next
      frame decides;
    * if bytes came faster than the line can send them, because they had waited;
    * if the frame is a text or a text follows it, because a paused board is not due to send frames.

    The line was idle if a text begins at the pause, if the bytes after the frame do not begin one,
    or if ticks that were read one by one are equally late.
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
    """Return the cause of the pause, decided by the frame that begins at ``start``.

    The line was idle if that frame is split by a pause too, whole ticks after the first one. The
    reader was late if it is in one piece. ``first``: the read that ended the first pause.
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
