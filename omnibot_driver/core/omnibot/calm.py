# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The commonest frames, quickly: IMU readings and deltas that nothing at all speaks against.

It takes what the decoder's own loop would take with the evidence ``weigh`` finds, and nothing else:
a test holds one against the other. What costs anything is left to that loop.
"""

import struct
from typing import Any, Final

from omnibot_driver.core.omnibot.evidence import LARGEST_DELTA, Context, Expectation
from omnibot_driver.core.omnibot.frames import (
    DELTA_HEADER,
    DELTA_LENGTH,
    IMU_HEADER,
    IMU_LENGTH,
    DeltaFrame,
    Frame,
    ImuFrame,
)

LENT: Final = (0xFF, 0xFA, 0xFB, 0xFC)
"""Last bytes of a frame that may be the first of a header, or its second."""

_FIRST, _IMU_KIND = IMU_HEADER
_DELTA_KIND = DELTA_HEADER[1]
_IMU: Final = struct.Struct(">6h").unpack_from
_DELTA: Final = struct.Struct(">3hB").unpack_from

LEARN_EVERY: Final = 8
"""Frames; more would teach the expectation nothing new."""


class Walk:
    """Frames in a row, from the first byte held on, that nothing speaks against.

    ``ends``: of each; ``before_last``: what was known before the last two (fields of a Context);
    ``lessons``: numbers of frames from which the expectation is to learn, each with two readings.
    """

    __slots__ = ("before_last", "ends", "frames", "lessons")

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.ends: list[int] = []
        self.before_last: tuple[tuple[Any, ...], tuple[Any, ...]] = ((), ())
        self.lessons: list[tuple[int, ImuFrame, ImuFrame]] = []

    def add(self, end: int, frame: Frame, before: Context) -> None:
        """One more."""
        number = len(self.frames)
        is_lesson = not number % LEARN_EVERY and not before.imus & 3
        if is_lesson and type(frame) is ImuFrame and before.imu is not None:
            self.lessons.append((number, frame, before.imu))
        self.frames.append(frame)
        self.ends.append(end)
        self.before_last = self.before_last[1], before


def take_calm(
    held: bytearray, at: int, context: Context, expectation: Expectation, walk: Walk
) -> tuple[int, Context]:
    """Add the calm frames that begin here; where they end, and what is known then.

    The last one in hand is left out where its last byte may be lent.
    """
    last, seq, pose, imus, deltas, shaken, turned = context
    if last is None:
        return at, context
    known: tuple[Any, ...] = context
    before_that, before = walk.before_last
    frames, ends = walk.frames, walk.ends
    lightest, heaviest, far, fast = expectation.calm
    px, py, pz = last.accel
    pu, pv, pw = last.gyro
    size = len(held)
    frame: Frame
    while at + DELTA_LENGTH <= size and held[at] == _FIRST:
        kind = held[at + 1]
        if kind == _IMU_KIND and at + IMU_LENGTH <= size:
            x, y, z, u, v, w = _IMU(held, at + 2)
            end = at + IMU_LENGTH
            if not (
                lightest < x * x + y * y + z * z < heaviest
                and -far < x - px < far
                and -far < y - py < far
                and -far < z - pz < far
                and -fast < u - pu < fast
                and -fast < v - pv < fast
                and -fast < w - pw < fast
            ) or (end == size and w & 0xFF in LENT):
                break
            px, py, pz, pu, pv, pw = x, y, z, u, v, w
            reading = ImuFrame((x, y, z), (u, v, w))
            if not imus & 3 and not len(frames) % LEARN_EVERY:
                walk.lessons.append((len(frames), reading, last))
            frame = last = reading
            imus, shaken = imus + 1, False
        elif kind == _DELTA_KIND and imus == 4:
            dx, dy, dtheta, count = _DELTA(held, at + 2)
            end = at + DELTA_LENGTH
            if (
                seq is None
                or count != (seq + 1) & 255
                or max(abs(dx), abs(dy), abs(dtheta)) > LARGEST_DELTA
                or (end == size and count in LENT)
            ):
                break
            frame = DeltaFrame(dx, dy, dtheta, count)
            seq, imus, deltas = count, 0, deltas + 1
            turned = None if turned is None else turned + dtheta
        else:
            break
        frames.append(frame)
        ends.append(end)
        before_that, before = before, known
        known = (last, seq, pose, imus, deltas, shaken, turned)
        at = end
    walk.before_last = before_that, before
    return at, Context._make(known)
