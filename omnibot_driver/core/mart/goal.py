# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""To a pose by controlled moves: turn towards it, drive straight, turn to its heading.

Each move is whole degrees or inches, and ends a little beside its target, so the way is planned
anew after each. Knows poses and the words of moves; not when they are said.
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
MOST_MOVES: Final = 9
"""A goal that is not reached by then is left as it is."""


@dataclass(slots=True)
class Move:
    """The way to one goal. ``said``: moves so far; ``given_up``: one of them has failed."""

    place: Pose
    said: int = 0
    given_up: bool = False


def next_move(move: Move, pose: Pose, settings: MartSettings) -> Request | None:
    """What leads on from here; None at the goal, or when it is given up."""
    if move.given_up or move.said >= MOST_MOVES:
        return None
    way = pose.way_to(move.place)
    inches = round(way.way_m / INCH_M)
    if way.way_m <= NEAR_M or inches < 1:
        return _turn(way.yaw_rad)
    bearing_rad = math.atan2(way.y_m, way.x_m)
    backward = settings.allow_reverse_goals and abs(bearing_rad) > math.pi / 2
    if backward:
        bearing_rad = math.remainder(bearing_rad - math.pi, math.tau)
    if turn := _turn(bearing_rad, max(NEAR_RAD, math.atan2(NEAR_M / 2, way.way_m))):
        return turn
    word = TB if backward else TF
    return word.request(*(("SLOW",) if inches < SLOW_BELOW_IN else ()), inches)


def _turn(angle_rad: float, near_rad: float = NEAR_RAD) -> Request | None:
    degrees = round(abs(math.degrees(angle_rad)))
    if abs(angle_rad) <= near_rad or degrees < 1:
        return None
    word = MCL if angle_rad > 0.0 else MCR
    return word.request(*(("SLOW",) if degrees < SLOW_BELOW_DEG else ()), degrees)
