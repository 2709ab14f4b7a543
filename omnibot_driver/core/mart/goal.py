# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The plan of moves to a goal pose: turn towards it, drive straight, turn to its heading.

Each move is planned after the previous one was measured. This module knows poses and commands for
moves; it does not know when they are sent.
"""

import math
from dataclasses import dataclass
from typing import Final

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.mart.settings import MartSettings
from omnibot_driver.core.mart.words import MCL, MCR, TB, TF, Request

INCH_M: Final = 0.0254
NEAR_M: Final = 0.04
NEAR_RAD: Final = math.radians(2.5)
SLOW_BELOW_DEG, SLOW_BELOW_IN = 10, 12
NORMAL_UNITS: Final = 30
"""Motor units of controlled moves at normal speed, which are sent without the word SLOW."""
ENOUGH_MOVES, ENOUGH_M = 4, 0.08
"""After ``ENOUGH_MOVES`` moves, a distance of up to ``ENOUGH_M`` (in m) from the goal is accepted.

Until then, the limit is ``NEAR_M``, which is smaller.
"""
STRETCH: Final = 1.3
"""Assumed ratio of driven to requested length of a straight move, until one has been measured.

For example, the robot drives 15.8 inches instead of 12.
"""
DOCK_STRETCH: Final = 1.6
"""Assumed largest ratio of driven to requested length of a docking move.

The driver requests ``dock_distance`` divided by this ratio, so that the robot does not drive
farther.
"""
MOST_SURPLUS_DEG: Final = 10.0
WORTH_DEG: Final = 1.0
"""Smallest reduction of the heading error, in degrees, for which the robot makes a turn."""
WIDER: Final = 0.5
"""Growth of the allowed heading error with each turn since the last straight move, as a fraction of
NEAR_RAD. This growth keeps the robot from turning back and forth."""
MOST_MOVES: Final = 9
"""Largest number of moves to one goal. If more are needed, the driver gives the goal up.

A straight move that takes too long sets the count of moves to zero (``Move.cut``): a distant goal
needs several straight moves.
"""


class Surplus:
    """The measured excess of controlled moves over the requested distances and turns.

    The excess of a turn is in degrees. The excess of a straight move is a ratio (driven /
    requested).
    """

    def __init__(self) -> None:
        self._degrees = {True: 0.0, False: 0.0}
        self._stretch = {True: STRETCH, False: STRETCH}
        self._learned: set[bool] = set()

    def learn(self, request: Request, way_m: float, turned_rad: float) -> None:
        """Learn from a finished move how much farther it went than requested.

        ``way_m``, ``turned_rad``: the measured distance and turn. Their signs do not matter.
        """
        parts = request.data.split()
        slow, asked = b"SLOW" in parts, float(parts[-1])
        if request.word in (TF, TB):
            seen = min(2.0, max(0.5, abs(way_m) / INCH_M / asked))
            self._stretch[slow] += (seen - self._stretch[slow]) / 2
            self._learned.add(slow)
            return
        beyond = abs(math.degrees(turned_rad)) - asked
        before = self._degrees[slow]
        self._degrees[slow] = min(MOST_SURPLUS_DEG, max(0.0, before + (beyond - before) / 2))

    def degrees(self, wanted: float, *, slow: bool) -> int:
        """Return the degrees to request, so that the robot turns by ``wanted`` degrees.

        The result is 0 if the turn would reduce the heading error by ``WORTH_DEG`` or less.
        """
        surplus = self._degrees[slow]
        asked = max(1, round(wanted - surplus))
        return asked if abs(asked + surplus - wanted) < wanted - WORTH_DEG else 0

    def is_known(self, request: Request) -> bool:
        """Return whether the driver knows how far a complete move of this kind goes.

        The result is True for turns, because the server ends turns by its gyro. Straight moves must
        be measured first.
        """
        return request.word in (MCR, MCL) or (b"SLOW" in request.data.split()) in self._learned

    def expected(self, request: Request) -> float:
        """Return the distance forward in m, or the turn to the left in rad, of a complete move."""
        parts = request.data.split()
        slow, asked = b"SLOW" in parts, float(parts[-1])
        sign = -1.0 if request.word in (TB, MCR) else 1.0
        if request.word in (TF, TB):
            return sign * asked * INCH_M * self._stretch[slow]
        return sign * math.radians(asked + self._degrees[slow])

    def inches(self, way_m: float, *, slow: bool) -> int:
        """Return the number of inches to request, so that the robot drives ``way_m``."""
        return max(1, round(way_m / INCH_M / self._stretch[slow]))


def docking_inches(longest_m: float) -> int:
    """Return the number of inches to request for a docking move of at most ``longest_m``."""
    return max(1, math.floor(longest_m / INCH_M / DOCK_STRETCH))


@dataclass(slots=True)
class Move:
    """The progress towards the goal ``place``.

    * ``said``: number of sent moves that count towards the limit MOST_MOVES.
    * ``turns``: number of turns since the last straight move.
    * ``given_up``: whether no further move is sent: the robot has arrived, or the goal has failed.
    * ``failed``: whether a move has failed, or MOST_MOVES moves did not reach the goal.
    """

    place: Pose
    said: int = 0
    turns: int = 0
    given_up: bool = False
    failed: bool = False

    def fail(self) -> None:
        """Give the goal up, because it was not reached."""
        self.given_up = self.failed = True

    def repeated(self) -> "Move":
        """Return the ``Move`` to continue with when the goal ``place`` is commanded again.

        A failed goal begins anew. After a reached goal, another straight move is made only if the
        goal is more than ENOUGH_M (m) away.
        """
        if not self.given_up:
            return self
        if self.failed:
            return Move(self.place)
        return Move(self.place, said=ENOUGH_MOVES, turns=self.turns)

    def cut(self) -> None:
        """Count moves and turns from 0 again: the driver ended a straight move that took too long.

        The goal has not failed, because a goal that is far away needs several straight moves.
        """
        self.said = self.turns = 0

    def begin(self, request: Request) -> None:
        """Count the move that ``request`` commands.

        A turn also increases ``turns``, the number of turns since the last straight move. A
        straight move sets ``turns`` to 0.
        """
        self.said += 1
        self.turns = 0 if request.word in (TF, TB) else self.turns + 1


def next_move(move: Move, pose: Pose, settings: MartSettings, surplus: Surplus) -> Request | None:
    """Return the next move from ``pose``.

    Return None if the robot is at the goal, or if the goal is given up.
    """
    if move.given_up:
        return None
    way = pose.way_to(move.place)
    near_rad = NEAR_RAD * (1.0 + WIDER * move.turns)
    if way.way_m <= (NEAR_M if move.said < ENOUGH_MOVES else ENOUGH_M):
        return _turn(way.yaw_rad, near_rad, settings, surplus)
    bearing_rad = math.atan2(way.y_m, way.x_m)
    backward = settings.allow_reverse_goals and abs(bearing_rad) > math.pi / 2
    if backward:
        bearing_rad = math.remainder(bearing_rad - math.pi, math.tau)
    near_rad = max(near_rad, math.atan2(NEAR_M / 2, way.way_m))
    if turn := _turn(bearing_rad, near_rad, settings, surplus):
        return turn
    word = TB if backward else TF
    too_fast = NORMAL_UNITS * settings.speed_per_unit > settings.max_speed_mps
    slow = too_fast or way.way_m / INCH_M < SLOW_BELOW_IN
    return word.request(*(("SLOW",) if slow else ()), surplus.inches(way.way_m, slow=slow))


def _turn(
    angle_rad: float, near_rad: float, settings: MartSettings, surplus: Surplus
) -> Request | None:
    wanted = abs(math.degrees(angle_rad) / settings.heading_scale)
    normal_radps = 2 * NORMAL_UNITS * settings.speed_per_unit / settings.track_m
    slow = normal_radps > settings.max_yaw_rate_radps or wanted < SLOW_BELOW_DEG
    degrees = surplus.degrees(wanted, slow=slow)
    if abs(angle_rad) <= near_rad or not degrees:
        return None
    word = MCL if angle_rad > 0.0 else MCR
    return word.request(*(("SLOW",) if slow else ()), degrees)
