# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Writes motion lines (``rc``) without a checksum, in a form that limits the effect of damage.

Some losses, such as that of a decimal point, still give a wrong number until the next line.
"""

import math

from omnibot_driver.core.fejemis.motion_lines import LEAST_MPS, STOP


def plain_front_line(speed_mps: float, turn_radps: float) -> bytes:
    """Return the front board's line with few digits, because short lines are damaged less often."""
    return b"rc 2 %s %s" % (_short(speed_mps, 4), _short(math.degrees(turn_radps), 2))


def plain_drive_line(speed_mps: float, turn_radps: float) -> bytes:
    """Return the drive board's line: the outer wheel's speed with its sign, and a turn rate of 0.

    The board computes the turn from the angle of the front wheel.
    """
    # The line has a source (``2``), a speed and a turn rate. The board uses only the root of the
    # sum of squares. If the source or the space after it is lost, the 0 becomes the speed: the line
    # is a stop. If the space before the 0 is lost, the speed is the same: it has a decimal point,
    # so ``1. 0`` becomes ``1.0``, not ``10``.
    rim_mps = math.hypot(speed_mps, turn_radps)
    if rim_mps < LEAST_MPS:
        return STOP
    speed = f"{math.copysign(rim_mps, speed_mps or 1.0):.3f}".rstrip("0")
    return b"rc 2 %s 0" % speed.encode("ascii")


def _short(number: float, decimals: int) -> bytes:
    text = f"{number:.{decimals}f}".rstrip("0").rstrip(".")
    return (text if text.strip("-") else "0").encode("ascii")
