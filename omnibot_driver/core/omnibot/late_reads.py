# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The cause of a pause between two reads: an idle line, or a late reader.

* Idle line: if a supposed frame contains the pause, bytes were lost. The frames after the pause
  seem late by whole ticks.
* Late reader: no bytes were lost. The frames after the pause are on time again.

Input: lengths of frames, and positions and times of reads; this module does not know what a frame
contains, or which frames are accepted.
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
"""Shortest pause, in s, that is regarded as long: ten of the board's ticks. The pauses that an
adapter causes are at most 16 ms long."""
HALF_TICK_S: Final = TICK_S / 2
"""Half of a tick, in s. A frame that is late by less than this is regarded as on time."""
GAP_S: Final = 4e-3
"""Pause in s that is longer than any pause of the board within a frame."""
NEAR_S: Final = 2e-3
"""Tolerance in s for the check whether a delay is a whole number of ticks. Lost bytes make later
frames seem late by such a delay."""
INTO_TICK_S: Final = 1e-3
"""Time in s from the beginning of a tick until the board sends a delta or a pose. In this time, the
board sends the IMU frame of the tick."""
PUNCTUAL_S: Final = 1e-3
"""The delays of two punctual reads differ by at most this time, in s, even with a USB adapter."""
PACE_S: Final = 2e-4
"""Tolerance in s for the check whether bytes arrived as fast as the line sends them.

Within this tolerance, the bytes did not wait for the reader.
"""
FEW_BYTES: Final = 2
"""Largest number of bytes that is too small to measure how fast bytes arrive.

The measurement is made in the rest of a supposed frame, after the first read that follows a pause
in this frame.
"""
TICKS_TO_PROVE: Final = 2
"""Number of late ticks, after a first late tick, that prove that bytes were lost.

After a loss, all ticks are equally late. So only equally late ticks count, each in a separate read.
After a pause of ``IDLE_S`` or more, one further tick is enough.
"""
MOST_BYTES: Final = 6 * IMU_LENGTH
"""Largest number of bytes after a frame that are used to find the cause of a pause in this frame.
If these bytes do not prove a loss, a late reader is assumed."""


class Cause(Enum):
    """The causes of a pause between two reads."""

    LATE_READER = "late reader"
    UNDECIDED = "undecided"
    IDLE_LINE = "idle line"


class Read(NamedTuple):
    """A read of bytes.

    ``end``: position in the held bytes after the last byte of the read.

    ``now``: time of the read in s.
    """

    end: int
    now: float


_END: Final = attrgetter("end")


class Gap(NamedTuple):
    """A pause between two reads, caused by an idle line or by a late reader.

    * ``first``, ``before``: the first byte after the pause is one of the held bytes ``first`` to
      ``before`` - 1.
    * ``price``: cost of assuming that an idle line caused this pause within a frame.
    * ``pause_s``: time in s between the two reads.
    """

    first: int
    before: int
    price: float
    pause_s: float


def cause(
    gap: Gap, reads: list[Read], data: bytes | bytearray, start: int, end: int, byte_s: float
) -> Cause:
    """Return the cause of ``gap``, a pause within the supposed frame ``data[start:end]``.

    ``reads``: all reads since the pause. ``byte_s``: time in s that the line takes for a byte.

    UNDECIDED means that more bytes are needed.
    """
    # A paused board does not send frames in ticks.
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
        # Later bytes are on time again, so the reader was late. If all bytes came at the line's
        # pace, the supposed frame may be wrong instead.
        if late_s < latest_s:
            if paced and at_pace:
                return _by_the_next_frame(reads, first, data, rest_end, byte_s)
            return Cause.LATE_READER
        # Bytes that came faster than the line sends had waited to be read.
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
    """Return the cause of a pause within a supposed frame, judged by the next frame.

    The result is UNDECIDED while the next frame, at ``start``, is incomplete. ``first``: the read
    that ended the pause.
    """
    length = measure(data, start) if start < len(data) else INCOMPLETE
    if length <= 0:
        return Cause.UNDECIDED if length == INCOMPLETE else Cause.IDLE_LINE
    end = start + length
    for before, after in pairwise(reads):
        pause_s = after.now - before.now - (after.end - before.end) * byte_s
        if start < before.end < end and pause_s > GAP_S:
            # After an idle line, both pauses end at the beginning of a tick.
            ticks_s = after.now - first.now
            punctual = abs(remainder(ticks_s, TICK_S)) < PACE_S
            return Cause.IDLE_LINE if punctual else Cause.LATE_READER
    return Cause.LATE_READER
