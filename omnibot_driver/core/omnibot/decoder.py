# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The frame decoder: finds frames in a stream of bytes, and proves that they are frames.

A header alone proves nothing: data of a gyro at rest can look like a header. A frame that directly
follows an accepted one is *in step*. It is accepted, except if evidence speaks against it. All
other bytes are *uncertain*. They wait for a clear result of the search in ``trellis``; when
``DOUBT_BYTES`` wait, the decoder decides about the first half.

This module reads no clock, and no input makes it raise an exception.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from omnibot_driver.core.omnibot import cost_model
from omnibot_driver.core.omnibot.cost_model import NOTHING_KNOWN, Context, Expectation
from omnibot_driver.core.omnibot.fast_path import Walk, goes_on, take_run
from omnibot_driver.core.omnibot.frames import (
    DELTA_LENGTH,
    INCOMPLETE,
    NO_FRAME,
    ByteOrder,
    Frame,
    PausedFrame,
    decode_measured,
    measure,
)
from omnibot_driver.core.omnibot.gaps import BYTE_S, NORMAL_PAUSE_S, TICK_BYTES, InterFrameGaps
from omnibot_driver.core.omnibot.late_reads import IDLE_S
from omnibot_driver.core.omnibot.schedule import USUAL, Schedule
from omnibot_driver.core.omnibot.trellis import Segment, read

SPOKEN_AGAINST: Final = 3.0
"""A frame must wait if the cost of its content is at least this value. The bytes after the frame
then decide whether the decoder accepts it."""
DOUBT_BYTES: Final = 170
"""Largest number of uncertain bytes. When this number is reached, the decoder decides on the first
half of these bytes. In nominal mode, the board sends this number of bytes in 100 ms."""
SHORTEST_RUN: Final = DELTA_LENGTH
"""Least number of bytes for which the fast path is tried: the length of the shortest frame."""
CALM_S: Final = 10.0
"""Time in s without damage after which a line is regarded as calm: it loses few bytes.

On a calm line, the decoder needs less evidence to accept the last byte of a frame.
"""
FRAMES_TO_SETTLE: Final = 3
"""An uncertain frame is discarded as soon as this number of certain frames has followed it."""


@dataclass(slots=True)
class DecoderStatistics:
    """Counters of a decoder. Several decoders, one after another, may add to the same counters."""

    frames: int = 0
    discarded_bytes: int = 0
    faults: int = 0
    """Number of accepted frames that were followed by bytes that are not a frame."""


class FrameDecoder:
    """Finds the frames in the bytes of a line, which may arrive in chunks of any size.

    ``single_imu`` decodes some frames without this class, and must update these attributes:
    ``context``, ``expectation``, ``pauses``, ``last_arrival_s`` and ``statistics``.
    """

    def __init__(
        self,
        pose_byte_order: ByteOrder = "big",
        accel_counts_per_g: float = 16384.0,
        byte_s: float = BYTE_S,
        schedule: Schedule = USUAL,
    ) -> None:
        self.statistics = DecoderStatistics()
        self.skipped: list[int] = []
        """Number of discarded bytes right before each frame that ``feed`` or ``flush`` returned."""
        self.at_rest = False
        """Whether a fast path may decode the next bytes. If so, the decoder holds no bytes, and
        recent pauses of the line were between frames."""
        self._dropped = self._arrived = self._wait_for = 0
        self._pose_byte_order: ByteOrder = pose_byte_order
        self.expectation = Expectation(accel_counts_per_g, schedule)
        self.context = NOTHING_KNOWN
        self._held = bytearray()
        self._in_step = False
        self.pauses = InterFrameGaps(byte_s)
        self.last_arrival_s = self._damaged_at_s = -math.inf

    def feed(self, data: bytes, now: float) -> list[Frame]:
        """Return the frames that these bytes complete, in the order in which they were sent.

        ``now``: arrival time in s, of any steady clock.
        """
        found: list[Frame] = []
        self.skipped = []
        if not data:
            return found
        self._arrived = len(data)
        pause_s, self.last_arrival_s = now - self.last_arrival_s, now
        if self.at_rest and self._take_whole(data, pause_s, found):
            return found
        pauses = self.pauses
        if pause_s >= IDLE_S and len(data) <= TICK_BYTES:
            self.context = self.context.damaged() if self._held else NOTHING_KNOWN
        pauses.read(pause_s, len(data), len(self._held), now)
        self._held += data
        self._settle(found, closed=False)
        self.at_rest = pauses.sharp and pauses.between and self._in_step and not self._held
        return found

    def flush(self, now: float) -> list[Frame]:
        """Return the last frames in the bytes that are still held.

        Call this after the line was closed or fell silent.
        """
        self.last_arrival_s = now
        found: list[Frame] = []
        self.skipped = []
        self.at_rest = False
        self.pauses.clear()
        if self._held:
            self._settle(found, closed=True)
            self._drop(len(self._held))
        self.context = NOTHING_KNOWN
        return found

    @property
    def begun(self) -> bytes | None:
        """The received part of the next frame; None while the framing is uncertain."""
        held = self._held
        if not self._in_step:
            return None
        if held and (len(held) > TICK_BYTES // 2 or measure(held, 0) == NO_FRAME):
            return None
        return bytes(held)

    @property
    def fresh(self) -> bool:
        """Whether some bytes of the last accepted frame arrived with the last call of ``feed``."""
        return len(self._held) < self._arrived

    def _take_whole(self, data: bytes, pause_s: float, found: list[Frame]) -> bool:
        """Accept ``data`` if it consists only of expected frames with usual content.

        Return whether ``data`` is accepted.
        """
        if pause_s > NORMAL_PAUSE_S or len(data) > TICK_BYTES:
            return False
        walk, order = Walk(self.context), self._pose_byte_order
        end, context = take_run(data, 0, self.context, self.expectation, order, walk)
        if end < len(data):
            return False
        self._take(walk, len(walk.frames), context, found)
        self.pauses.stood_between(pause_s, len(data))
        return True

    def _settle(self, found: list[Frame], *, closed: bool) -> None:
        """Decode the held bytes until none is left, or until a decision needs more bytes."""
        held = self._held
        while held:
            if not closed and len(held) < self._wait_for:
                return
            if self._in_step and self._walk(found, closed):
                return
            stretch = bytes(held[:DOUBT_BYTES])
            last = closed and len(stretch) == len(held)
            if not self._judge(stretch, found, closed=last):
                self._wait_for = min(DOUBT_BYTES, len(held) + 1 + len(held) // 16)
                return

    def _walk(self, found: list[Frame], closed: bool) -> bool:
        """Accept consecutive frames. If a frame is uncertain, stop and return False."""
        held, gaps, expectation = self._held, self.pauses.gaps, self.expectation
        order, context = self._pose_byte_order, self.context
        at, size, walk = 0, len(held), Walk(context)
        while at < size:
            paused = gaps and gaps[-1].first > at  # within the bytes from ``at`` on
            if not paused and size - at >= SHORTEST_RUN:
                at, context = take_run(held, at, context, expectation, order, walk)
                if at == size:
                    break
            length = measure(held, at)
            end = at + length
            silent = paused and self.pauses.silent_within(at, size)
            if length == INCOMPLETE and not (closed or silent):
                break
            if length <= 0:
                return self._believe_but_the_last(walk, found)
            if paused:
                if self.pauses.undecided(held, at, end):
                    break
                if self.pauses.against(held, at, end):
                    return self._believe_but_the_last(walk, found)
            frame = decode_measured(held[at:end], order)
            cost, after = expectation.weigh(frame, context)
            if cost >= SPOKEN_AGAINST and (
                cost >= cost_model.LOOK_ALIKE or not goes_on(held, end, closed=closed)
            ):
                return self._believe_but_the_last(walk, found)
            if (
                end == size
                and not closed
                and cost_model.may_be_lent(frame, context)
                and self._next_may_have_begun(at, length, expectation.more_is_due(frame, context))
            ):
                break
            walk.add(end, frame, context)
            context = after
            at = end
        self._take(walk, len(walk.frames), context, found)
        return True

    def _next_may_have_begun(self, start: int, length: int, due: bool) -> bool:
        """Return whether the last byte held may begin another frame, judged by the arrival times.

        ``start``, ``length``: position and length of the last frame held. ``due``: whether another
        frame may follow this frame directly.
        """
        pauses, calm = self.pauses, self.calm
        # The last frame came in one read. If frames begin only after a pause, no other frame
        # begins in this read.
        if self._arrived >= length:
            return not (pauses.sharp or (calm and pauses.collected and not due))
        in_time = pauses.at_pace or (calm and pauses.in_its_tick(start))
        return due or not (pauses.sharp and in_time)

    @property
    def calm(self) -> bool:
        """Whether the decoder has not discarded any bytes for longer than ``CALM_S``."""
        return self.last_arrival_s - self._damaged_at_s > CALM_S

    def _believe_but_the_last(self, walk: Walk, found: list[Frame]) -> bool:
        """Accept the frames of ``walk``, a run of frames, except the last two; always return False.

        The last two frames are uncertain, because the bytes after them are unusual.
        """
        believed = len(walk.frames) - 2
        if believed > 0:
            self._take(walk, believed, walk.known_after(believed, self.expectation), found)
        return False

    def _take(self, walk: Walk, count: int, after: Context, found: list[Frame]) -> None:
        if not count:
            return
        self.statistics.frames += count
        for number, frame, before in walk.lessons:
            if number < count:
                self.expectation.learn(frame, before)
        found += walk.frames[:count]
        self.skipped.append(self._dropped)
        if count > 1:
            self.skipped += [0] * (count - 1)
        self._dropped = 0
        self.context = after
        end = walk.ends[count - 1]
        if self.pauses.gaps:
            self.pauses.compare(walk.ends[:count])
            self.pauses.forget(end)
        del self._held[:end]
        self._wait_for = 0

    def _judge(self, stretch: bytes, found: list[Frame], *, closed: bool) -> bool:
        """Accept the frames that are certain, and discard bytes in which no frame is certain.

        Return False if the method could neither accept nor discard anything.
        """
        state = self.context, self.expectation, self.pauses, self._pose_byte_order
        pieces = read(stretch, *state, in_step=self._in_step, closed=closed)
        half = len(stretch) // 2 if len(stretch) == DOUBT_BYTES else 0
        at = 0
        for piece, sure in self._settled(pieces, len(stretch), half, closed):
            if sure:
                self._drop(piece.start - at)
                walk = Walk(piece.before)
                walk.add(piece.end - piece.start, piece.frame, piece.before)
                self._take(walk, 1, piece.after, found)
                self._in_step = True
            else:
                self._drop(piece.end - at)
            at = piece.end
        if half and not at:
            at = min(half, pieces[0].start) if pieces else half
            self._drop(at)
            self.pauses.doubt()
        return at > 0

    def _settled(
        self, pieces: list[Segment], size: int, until: int, closed: bool
    ) -> Iterator[tuple[Segment, bool]]:
        """Yield each supposed frame, and whether it is accepted; end at the first undecided frame.

        ``until``: frames that end at this position or before are decided in any case.
        """
        last_sure = [n for n, piece in enumerate(pieces) if piece.sure]
        settled_before = last_sure[-FRAMES_TO_SETTLE] if len(last_sure) >= FRAMES_TO_SETTLE else 0
        in_step, end = self._in_step, -1
        is_unused = not in_step and self._damaged_at_s == -math.inf  # nothing accepted or discarded
        # The only frame of a closed line is trusted, except if evidence speaks against it.
        alone = closed and len(pieces) == 1 and pieces[0].start == 0 and is_unused
        if alone:
            cost, _ = self.expectation.weigh(pieces[0].frame, pieces[0].before)
            alone = cost < SPOKEN_AGAINST
        for number, piece in enumerate(pieces):
            proved = (
                in_step
                or piece.start == end
                or any(piece.end == after.start for after in pieces[number + 1 : number + 2])
                or type(piece.frame) is PausedFrame
                or (alone and piece.end == size)
            )
            sure = proved and piece.sure
            if (
                piece.end == size
                and not closed
                and cost_model.may_be_lent(piece.frame, piece.before)
            ):
                return
            if not (sure or closed or number < settled_before or piece.end <= until):
                return
            end = piece.end if sure else -1
            yield piece, sure

    def _drop(self, count: int) -> None:
        if not count:
            return
        self._damaged_at_s = self.last_arrival_s
        self.statistics.discarded_bytes += count
        self._dropped += count
        self.statistics.faults += self._in_step
        self._in_step = False
        self.context = self.context.damaged()
        self.pauses.forget(count)
        del self._held[:count]
        self._wait_for = 0
