"""The commonest frames, quickly: IMU readings in a row that nothing at all speaks against.

It takes what the decoder's own loop would take with the evidence ``weigh`` finds, and nothing else:
a test holds one against the other. What costs anything is left to that loop.
"""

import struct
from typing import Final

from omnibot_driver.core.omnibot.evidence import Context, Expectation
from omnibot_driver.core.omnibot.frames import IMU_HEADER, IMU_LENGTH, Frame, ImuFrame

LENT: Final = (0xFF, 0xFA, 0xFB, 0xFC)
"""Last bytes of a frame that may be the first of a header, or its second."""

_WORDS: Final = struct.Struct(">6h").unpack_from
_FIRST, _SECOND = IMU_HEADER

Step = tuple[int, Frame, Context]
"""The end of a frame, the frame, what was known before it."""


def take_calm(
    held: bytearray, at: int, context: Context, expectation: Expectation, steps: list[Step]
) -> tuple[int, Context]:
    """Append the calm frames that begin here; where they end, and what is known then.

    The last one in hand is left out where its last byte may be lent.
    """
    last, seq, pose, imus, deltas, _, turned = context
    if last is None:
        return at, context
    lightest, heaviest, far, fast = expectation.calm
    px, py, pz = last.accel
    pu, pv, pw = last.gyro
    size = len(held)
    end = at + IMU_LENGTH
    while end <= size and held[at] == _FIRST and held[at + 1] == _SECOND:
        x, y, z, u, v, w = _WORDS(held, at + 2)
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
        frame = ImuFrame((x, y, z), (u, v, w))
        steps.append((end, frame, context))
        imus += 1
        # What Context(...) does, without the call into Python that takes longer than this loop.
        context = tuple.__new__(Context, (frame, seq, pose, imus, deltas, False, turned))
        px, py, pz, pu, pv, pw = x, y, z, u, v, w
        at, end = end, end + IMU_LENGTH
    return at, context
