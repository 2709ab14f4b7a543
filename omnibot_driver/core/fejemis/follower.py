# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Checks that the front wheel follows its commanded angle, and otherwise refuses motion.

The refusal ends when the wheel moves, or with ~/start; after a second fault within 60 s, only with
~/start.
"""

import math
from typing import Final

FOLLOWS_WITHIN_S: Final = 1.0
"""Time in s within which the front wheel must come nearer to its commanded angle. If it does not,
it has a fault."""
NEARER_RAD: Final = math.radians(1.0)
FOLLOWS_RAD: Final = math.radians(12.0)
"""Tolerated deviation of the front wheel from its commanded angle, in rad, while the robot drives.
"""
MOVED_RAD: Final = math.radians(3.0)
"""Angle in rad by which a stuck wheel must turn before the robot may move again."""
AGAIN_WITHIN_S: Final = 60.0
UNTIL_IT_MOVES: Final = (
    "the front wheel did not go where it was commanded; check the servo and its power. Motion is"
    " refused until the wheel has moved, or ~/start is called"
)
UNTIL_START: Final = (
    "for the second time within 60 s, the front wheel did not go where it was commanded; check the"
    " servo and its power. If the robot was driving backward, set `allow_reverse` to false. Then"
    " call ~/start"
)


class Follower:
    """Checks that the front wheel follows its commanded angle, and otherwise refuses motion.

    ``refusal``: why the robot must not be driven; empty if driving is allowed.
    """

    def __init__(self) -> None:
        self.refusal = ""
        self._stuck_rad = math.nan
        self._fault_at = -math.inf
        self.begin()

    def begin(self) -> None:
        """Forget the commanded angle."""
        self._angle_rad: float | None = None
        self._within_rad = FOLLOWS_RAD
        self._since, self._from_rad = math.inf, math.nan

    def start(self) -> None:
        """Forget all faults, because the user has called ~/start."""
        self.refusal, self._fault_at = "", -math.inf

    def aim(self, angle_rad: float, within_rad: float = FOLLOWS_RAD) -> None:
        """Set the front wheel's target angle, and the allowed deviation from it, both in rad."""
        self._angle_rad, self._within_rad = angle_rad, within_rad

    def look(self, angle_rad: float, now: float) -> bool:
        """Receive the measured angle in rad; return whether a new fault of the wheel is found."""
        if self.refusal == UNTIL_IT_MOVES and abs(angle_rad - self._stuck_rad) > MOVED_RAD:
            self.refusal = ""
        if self._angle_rad is None or self.refusal:
            return False
        off_rad = self._angle_rad - angle_rad
        if abs(off_rad) <= self._within_rad:
            self._since, self._from_rad = now, angle_rad
            return False
        nearer_rad = math.copysign(1.0, off_rad) * (angle_rad - self._from_rad)
        if math.isnan(nearer_rad) or nearer_rad > NEARER_RAD:
            self._since, self._from_rad = now, angle_rad
        if now - self._since <= FOLLOWS_WITHIN_S:
            return False
        # After the second fault, only ~/start allows motion. Otherwise a node that keeps commanding
        # would move the robot for a second again and again.
        second = now - self._fault_at < AGAIN_WITHIN_S
        self.refusal = UNTIL_START if second else UNTIL_IT_MOVES
        self._fault_at, self._stuck_rad = now, angle_rad
        self._since, self._from_rad = math.inf, math.nan
        return True
