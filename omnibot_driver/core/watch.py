# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Whether the robot does what it is told, as far as its displacements tell.

Nothing acknowledges a command, but a robot that is commanded and does not move, or that moves and
is not commanded, shows it. Time is the board's own. In IMU-only mode nothing is told, and nothing
is found.
"""

import math
from enum import Enum
from typing import Final

from omnibot_driver.core.board import DisplacementReading
from omnibot_driver.core.motion import Motion

MOVING_MPS: Final = 0.02
MOVING_RADPS: Final = 0.05
"""Faster than rounding and a creaking wheel."""
STUCK_S: Final = 1.0
ASTRAY_S: Final = 0.2
ROLLED_OUT_S: Final = 1.5
"""After this a robot that was told to stand stands, the second of Stops included."""
AGAIN_S: Final = 1.0


class Finding(Enum):
    """What is wrong, as a sentence that says what to do."""

    HELD = (
        "the e-stop is released and the robot is commanded, but does not move: the board seems to"
        " hold the stop itself; call ~/reset"
    )
    STUCK = (
        "the robot is commanded and does not move: check motor power, whether the wheels are"
        " blocked, and that `control_method` says where the board's switch stands"
    )
    ASTRAY = (
        "the robot moves although it is to stand: if nobody pushes it, the board does not hear us;"
        " Stop is repeated. Switch the motors off by hand, and check the cable"
    )


class Watch:
    """Looks at every displacement, together with what was commanded then."""

    def __init__(self) -> None:
        self._released = False
        self._told: set[Finding] = set()
        self.begin()

    def begin(self) -> None:
        """What was seen so far says nothing of what comes."""
        self._stuck_s = self._standing_s = self._moving_s = 0.0

    def release(self) -> None:
        """The e-stop is released; the robot has not moved since."""
        self._released = True

    def is_news(self, finding: Finding) -> bool:
        """Once, until the robot has obeyed again."""
        told, self._told = self._told, self._told | {finding}
        return finding not in told

    def look(self, reading: DisplacementReading, commanded: Motion | None) -> Finding | None:
        """What this displacement proves; again while it goes on, once a second."""
        if not reading.duration_s:
            self.begin()
            return None
        seconds = reading.duration_s
        moves = (
            math.hypot(reading.dx_m, reading.dy_m) > MOVING_MPS * seconds
            or abs(reading.dyaw_rad) > MOVING_RADPS * seconds
        )
        plain = commanded is not None and commanded.plain
        stands = commanded is None or commanded.stands
        self._stuck_s = self._stuck_s + seconds if plain and not moves else 0.0
        self._standing_s = self._standing_s + seconds if stands else 0.0
        self._moving_s = self._moving_s + seconds if moves else 0.0
        if plain and moves:
            self._released = False
            self._told = set()
        if self._stuck_s > STUCK_S:
            self._stuck_s = STUCK_S - AGAIN_S
            return Finding.HELD if self._released else Finding.STUCK
        if self._standing_s > ROLLED_OUT_S and self._moving_s > ASTRAY_S:
            self._standing_s = ROLLED_OUT_S - AGAIN_S
            return Finding.ASTRAY
        return None
