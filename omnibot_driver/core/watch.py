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


class Finding(Enum):
    """What is wrong."""

    STUCK = "it is commanded, and does not move"
    ASTRAY = "it is to stand, and moves"


class Watch:
    """Looks at every displacement, together with what was commanded then."""

    def __init__(self) -> None:
        self.obeys = False
        """Whether the robot moved when it was last looked at, as it was told to."""
        self._stuck_s = self._standing_s = self._moving_s = 0.0

    def begin(self) -> None:
        """What was seen so far says nothing of what comes."""
        self.obeys = False
        self._stuck_s = self._standing_s = self._moving_s = 0.0

    def look(self, reading: DisplacementReading, commanded: Motion | None) -> Finding | None:
        """What this displacement proves; again while it goes on, but once a second at most."""
        if not reading.duration_s:
            self.begin()
            return None
        seconds = reading.duration_s
        moves = (
            math.hypot(reading.dx_m, reading.dy_m) > MOVING_MPS * seconds
            or abs(reading.dyaw_rad) > MOVING_RADPS * seconds
        )
        stands = commanded is None or commanded.stands
        plain = commanded is not None and commanded.plain
        self.obeys = plain and moves
        self._stuck_s = self._stuck_s + seconds if plain and not moves else 0.0
        self._standing_s = self._standing_s + seconds if stands else 0.0
        self._moving_s = self._moving_s + seconds if moves else 0.0
        if self._stuck_s > STUCK_S:
            self._stuck_s = 0.0
            return Finding.STUCK
        if self._standing_s > ROLLED_OUT_S and self._moving_s > ASTRAY_S:
            self._standing_s = ROLLED_OUT_S - 1.0
            return Finding.ASTRAY
        return None
