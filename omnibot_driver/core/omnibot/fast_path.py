# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The fast path: decodes frames with expected content more quickly than the decoder's own loop.

A test checks that the decoder's loop would accept the same frames. For a read of one IMU frame,
the module ``single_imu`` is faster still.
"""

import struct
from typing import Any, Final

from omnibot_driver.core.omnibot.cost_model import (
    FARTHEST_POSE,
    LONGEST_STEP,
    Context,
    Expectation,
)
from omnibot_driver.core.omnibot.frames import (
    DELTA_HEADER,
    DELTA_LENGTH,
    IMU_HEADER,
    IMU_LENGTH,
    LENT,
    NO_FRAME,
    POSE_HEADER,
    POSE_LENGTH,
    ByteOrder,
    DeltaFrame,
    Frame,
    ImuFrame,
    PoseFrame,
    measure,
)

_FIRST, _IMU_KIND = IMU_HEADER
_DELTA_KIND, _POSE_KIND = DELTA_HEADER[1], POSE_HEADER[1]
_IMU: Final = struct.Struct(">6h").unpack_from
_DELTA: Final = struct.Struct(">3hB").unpack_from
_POSE: Final = {
    "big": struct.Struct(">3fB").unpack_from,
    "little": struct.Struct("<3fB").unpack_from,
}

# To make a frozen object takes three times as long as to make an unfrozen one and then freeze it.
UnfrozenImu, UnfrozenDelta, UnfrozenPose = (
    type(kind.__name__, (), {"__slots__": vars(kind)["__slots__"]})
    for kind in (ImuFrame, DeltaFrame, PoseFrame)
)

LEARN_EVERY: Final = 8
"""Of consecutive frames, at most one in ``LEARN_EVERY`` is used to learn the usual scatter of the
IMU. More frames would add little."""


class Walk:
    """Consecutive frames at the start of the bytes that the decoder holds.

    No evidence speaks against these frames.

    * ``ends``: the position in the bytes after each frame.
    * ``lessons``: tuples for ``Expectation.learn``: number of frames before an IMU frame, this
      frame, and the previous IMU frame.
    * ``known``: tuples of a number of frames, and the fields of the ``Context`` after these frames.
    """

    __slots__ = ("ends", "frames", "known", "lessons")

    def __init__(self, context: Context) -> None:
        self.frames: list[Frame] = []
        self.ends: list[int] = []
        self.lessons: list[tuple[int, ImuFrame, ImuFrame]] = []
        self.known: list[tuple[int, Any]] = [(0, context)]

    def add(self, end: int, frame: Frame, before: Context) -> None:
        """Add a frame that ends at ``end``. ``before``: what the decoder knew before the frame."""
        number = len(self.frames)
        is_lesson = not number % LEARN_EVERY and not before.imus & 3
        if is_lesson and type(frame) is ImuFrame and before.imu is not None:
            self.lessons.append((number, frame, before.imu))
        self.known.append((number, before))
        self.frames.append(frame)
        self.ends.append(end)

    def known_after(self, count: int, expectation: Expectation) -> Context:
        """Return the context in which the frame after the first ``count`` frames is judged.

        The context is what the decoder knows from earlier frames.
        """
        place = len(self.known) - 1
        while self.known[place][0] > count:
            place -= 1
        at, fields = self.known[place]
        context = Context._make(fields)
        for frame in self.frames[at:count]:
            _, context = expectation.weigh(frame, context)
        return context


def goes_on(held: bytes | bytearray, at: int, *, closed: bool) -> bool:
    """Return whether a complete frame begins at ``at``, the end of a frame with unusual content.

    If so, a shock caused the content, not damage. If ``held`` ends at ``at``, the result is
    ``closed``: whether no more bytes will come.
    """
    if at == len(held):
        return closed
    length = measure(held, at)
    if length <= 0:
        return False
    at += length
    return at == len(held) or measure(held, at) != NO_FRAME


def take_run(
    held: bytes | bytearray,
    at: int,
    context: Context,
    expectation: Expectation,
    order: ByteOrder,
    walk: Walk,
) -> tuple[int, Context]:
    """Add the expected frames in ``held``, from ``at`` on, to ``walk``.

    Return the position and the context after these frames. The last frame is left out if its last
    byte may belong to the next header.
    """
    last, seq, pose, imus, deltas, shaken, turned = context
    if last is None:
        return at, context
    frames, ends = walk.frames, walk.ends
    lightest, heaviest, far, fast = expectation.calm
    per_delta, per_pose = expectation.imus_per_delta, expectation.deltas_per_pose
    back, slow = -far, -fast
    px, py, pz = last.accel
    pu, pv, pw = last.gyro
    size = len(held)
    final = size - 1
    frame: Any
    x: int  # a struct has no types, and compiled code is faster with integers
    y: int
    z: int
    u: int
    v: int
    w: int
    while at < final and held[at] == _FIRST:
        kind = held[at + 1]
        if kind == _IMU_KIND:
            end = at + IMU_LENGTH
            if end > final and (end > size or held[final] in LENT):
                break
            x, y, z, u, v, w = _IMU(held, at + 2)
            norm = x * x + y * y + z * z
            if not lightest < norm < heaviest:
                break
            if (
                back < x - px < far
                and back < y - py < far
                and back < z - pz < far
                and slow < u - pu < fast
                and slow < v - pv < fast
                and slow < w - pw < fast
            ):
                shaken = False
            elif shaken or goes_on(held, end, closed=False):
                shaken = True
            else:
                break
            px, py, pz = x, y, z
            pu, pv, pw = u, v, w
            frame = UnfrozenImu()
            frame.accel = x, y, z
            frame.gyro = u, v, w
            frame.__class__ = ImuFrame
            if not imus & 3:
                count = len(frames)
                if not count % LEARN_EVERY:
                    walk.lessons.append((count, frame, last))
                walk.known.append((count + 1, (frame, seq, pose, imus + 1, deltas, shaken, turned)))
            last = frame
            imus += 1
        elif kind == _DELTA_KIND and imus == per_delta:
            end = at + DELTA_LENGTH
            if end > size or seq is None:
                break
            dx, dy, dtheta, count = _DELTA(held, at + 2)
            largest = expectation.largest_delta
            if (
                count != (seq + 1) & 255
                or not -largest <= dx <= largest
                or not -largest <= dy <= largest
                or not -largest <= dtheta <= largest
                or (end == size and count in LENT)
            ):
                break
            frame = UnfrozenDelta()
            frame.dx, frame.dy = dx, dy
            frame.dtheta, frame.seq = dtheta, count
            frame.__class__ = DeltaFrame
            seq, imus, deltas = count, 0, deltas + 1
            turned = None if turned is None else turned + dtheta
        elif kind == _POSE_KIND and deltas == per_pose and imus == 0:
            end = at + POSE_LENGTH
            if end > size or pose is None or turned is None:
                break
            x_mm, y_mm, theta, count = _POSE[order](held, at + 2)
            rounding = expectation.rounding
            if (
                count != (pose.seq + 1) & 255
                or not -FARTHEST_POSE < x_mm < FARTHEST_POSE
                or not -FARTHEST_POSE < y_mm < FARTHEST_POSE
                or not -FARTHEST_POSE < theta < FARTHEST_POSE
                or not -LONGEST_STEP <= x_mm - pose.x <= LONGEST_STEP
                or not -LONGEST_STEP <= y_mm - pose.y <= LONGEST_STEP
                or not -LONGEST_STEP <= theta - pose.theta <= LONGEST_STEP
                or not -rounding <= 10.0 * (theta - pose.theta) - turned <= rounding
                or (end == size and count in LENT)
            ):
                break
            frame = UnfrozenPose()
            frame.x, frame.y, frame.theta, frame.seq = x_mm, y_mm, theta, count
            frame.__class__ = PoseFrame
            pose, deltas, turned = frame, 0, 0
        else:
            break
        frames.append(frame)
        ends.append(end)
        at = end
    return at, tuple.__new__(Context, (last, seq, pose, imus, deltas, shaken, turned))
