"""The commonest frames, quickly: IMU readings and deltas that nothing at all speaks against.

It takes what the decoder's own loop would take with the evidence ``weigh`` finds, and nothing else:
a test holds one against the other. What costs anything is left to that loop.
"""

import struct
from typing import Final

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

_IMU: Final = struct.Struct(">6h").unpack_from
_DELTA: Final = struct.Struct(">3hB").unpack_from

Step = tuple[int, Frame, Context]
"""The end of a frame, the frame, what was known before it."""


def take_calm(
    held: bytearray, at: int, context: Context, expectation: Expectation, steps: list[Step]
) -> tuple[int, Context]:
    """Append the calm frames that begin here; where they end, and what is known then.

    The last one in hand is left out where its last byte may be lent.
    """
    last, seq, pose, imus, deltas, shaken, turned = context
    if last is None:
        return at, context
    lightest, heaviest, far, fast = expectation.calm
    px, py, pz = last.accel
    pu, pv, pw = last.gyro
    size = len(held)
    frame: Frame
    while True:
        if held.startswith(IMU_HEADER, at) and at + IMU_LENGTH <= size:
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
                return at, context
            px, py, pz, pu, pv, pw = x, y, z, u, v, w
            frame = last = ImuFrame((x, y, z), (u, v, w))
            imus, shaken = imus + 1, False
        elif held.startswith(DELTA_HEADER, at) and at + DELTA_LENGTH <= size and imus == 4:
            dx, dy, dtheta, count = _DELTA(held, at + 2)
            end = at + DELTA_LENGTH
            if (
                seq is None
                or count != (seq + 1) & 255
                or max(abs(dx), abs(dy), abs(dtheta)) > LARGEST_DELTA
                or (end == size and count in LENT)
            ):
                return at, context
            frame = DeltaFrame(dx, dy, dtheta, count)
            seq, imus, deltas = count, 0, deltas + 1
            turned = None if turned is None else turned + dtheta
        else:
            return at, context
        steps.append((end, frame, context))
        # What Context(...) does, without the call that takes longer than all the rest.
        context = tuple.__new__(Context, (last, seq, pose, imus, deltas, shaken, turned))
        at = end
