# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Whether the front wheel goes where it is commanded, and when it is tried again if it does not.

A sender that goes on would otherwise move the robot for a second, again and again. So motion is
refused until the wheel has moved, and after a second fault within a minute until ~/start. Knows
angles and times; not what is commanded besides.
"""

import math
from typing import Final

FOLLOWS_WITHIN_S: Final = 1.0
"""A front wheel that gets no nearer to its angle within this time does not follow."""
NEARER_RAD: Final = math.radians(1.0)
FOLLOWS_RAD: Final = math.radians(12.0)
MOVED_RAD: Final = math.radians(3.0)
"""A wheel that has moved by this angle is tried again."""
AGAIN_WITHIN_S: Final = 60.0
UNTIL_IT_MOVES: Final = (
    "the front wheel did not go where it was commanded; check the servo and its power. Motion is"
    " refused until the wheel has moved, or ~/start is called"
)
UNTIL_START: Final = (
    "the front wheel did not go where it was commanded, for the second time within a minute; check"
    " the servo and its power, for reversing see `allow_reverse`; then call ~/start"
)


class Follower:
    """``refusal``: why the robot is not to be driven; empty while the wheel follows."""

    def __init__(self) -> None:
        self.refusal = ""
        self._stuck_rad = math.nan
        self._fault_at = -math.inf
        self.begin()

    def begin(self) -> None:
        """Nothing is commanded."""
        self._angle_rad: float | None = None
        self._since, self._from_rad = math.inf, math.nan

    def start(self) -> None:
        """The user has called ~/start."""
        self.refusal, self._fault_at = "", -math.inf

    def aim(self, angle_rad: float) -> None:
        """It is to stand here."""
        self._angle_rad = angle_rad

    def look(self, angle_rad: float, now: float) -> bool:
        """It stands there. Whether this shows, for the first time, that it does not follow."""
        if self.refusal == UNTIL_IT_MOVES and abs(angle_rad - self._stuck_rad) > MOVED_RAD:
            self.refusal = ""
        if self._angle_rad is None or self.refusal:
            return False
        off_rad = self._angle_rad - angle_rad
        if abs(off_rad) <= FOLLOWS_RAD:
            self._since, self._from_rad = now, angle_rad
            return False
        nearer_rad = math.copysign(1.0, off_rad) * (angle_rad - self._from_rad)
        if math.isnan(nearer_rad) or nearer_rad > NEARER_RAD:
            self._since, self._from_rad = now, angle_rad
        if now - self._since <= FOLLOWS_WITHIN_S:
            return False
        second = now - self._fault_at < AGAIN_WITHIN_S
        self.refusal = UNTIL_START if second else UNTIL_IT_MOVES
        self._fault_at, self._stuck_rad = now, angle_rad
        self._since, self._from_rad = math.inf, math.nan
        return True
