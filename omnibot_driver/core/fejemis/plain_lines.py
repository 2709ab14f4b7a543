# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""``rc`` without a sum: whatever is lost on the way is not seen, so the lines let little be lost.

A lost space, or a lost source, moves each number to the place before it. So the drive board, which
takes the root of the sum of both squares, gets it as the speed, with a turn rate of 0: moved, it
commands to stand. What remains is a lost point or a lost digit behind it; it is obeyed until the
next line, which comes with the next angle of the front wheel.
"""

import math

from omnibot_driver.core.fejemis.motion_lines import LEAST_MPS, STOP


def plain_front_line(speed_mps: float, turn_radps: float) -> bytes:
    """Few digits, as these are damaged more seldom."""
    return b"rc 2 %s %s" % (_short(speed_mps, 4), _short(math.degrees(turn_radps), 2))


def plain_drive_line(speed_mps: float, turn_radps: float) -> bytes:
    """The speed of the outer wheel, forward or backward; the angle of the front wheel does rest."""
    rim_mps = math.hypot(speed_mps, turn_radps)
    if rim_mps < LEAST_MPS:
        return STOP
    return b"rc 2 %s 0" % _short(math.copysign(rim_mps, speed_mps or 1.0), 3)


def _short(number: float, decimals: int) -> bytes:
    text = f"{number:.{decimals}f}".rstrip("0").rstrip(".")
    return (text if text.strip("-") else "0").encode("ascii")
