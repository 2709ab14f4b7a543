# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The angle of a controlled turn, as the server has recorded it (LAST TURN).

The reply to MCR and MCL does not contain the angle. The public server writes the angle at the
beginning of a file, as the integral of the gyro until the robot was at rest. The manual does not
describe this file, so the driver also works without it. This module knows the form of the file; it
does not know when the file is downloaded.
"""

import re
from typing import Final

from omnibot_driver.core.mart.words import Request

SAME_DEG: Final = 0.5
"""Largest accepted difference between the requested angle in degrees and the one in the file."""
_HEAD: Final = re.compile(
    rb"MC Spin sensor data log\r?\n"
    rb".*\nTarget motion \([^)]*\): (?P<asked>\d+\.\d+)\r?\n"
    rb".*\n +@ stop detected - (?P<turned>-?\d+\.\d+)\r?\n",
    re.DOTALL,
)


def recorded_deg(pieces: list[bytes], request: Request) -> float | None:
    """Return the angle of a turn in degrees, with the server's sign, from the pieces of its file.

    ``request``: the command of the turn. Returns None if the pieces are not from a record of this
    turn, or have no angle. The angle is in the first piece, so the loss of a later piece does no
    harm.
    """
    for piece in pieces:
        if head := _HEAD.match(piece):
            asked = float(request.data.split()[-1])
            if abs(float(head["asked"]) - asked) > SAME_DEG:
                return None
            return float(head["turned"])
    return None
