# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Goals are reached although controlled moves go beyond what was requested."""

import math
from random import Random

import pytest

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.mart import MartSettings
from omnibot_driver.core.mart.goal import INCH_M, MOST_MOVES, Move, Surplus, next_move
from omnibot_driver.core.mart.words import MCR, TB, TF


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("beyond_deg", [0.0, 3.0, 6.0, 9.0])
def test_small_turns_that_go_beyond_do_not_use_up_the_moves(beyond_deg: float, seed: int) -> None:
    """A turn by 1° that turns the robot by 7° is not repeated until no moves are left."""
    random, surplus, pose = Random(seed), Surplus(), Pose()
    for _ in range(12):
        goal = Pose(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-3, 3))
        move = Move(goal)
        while (request := next_move(move, pose, MartSettings(), surplus)) is not None:
            move.begin(request)
            asked = float(request.data.split()[-1])
            way_m = turn_rad = 0.0
            if request.word in (TF, TB):
                way_m = asked * INCH_M * random.uniform(1.15, 1.3)
            else:
                turn_rad = math.radians(asked + beyond_deg + random.uniform(-1, 1))
                turn_rad *= -1.0 if request.word is MCR else 1.0
            surplus.learn(request, way_m, turn_rad)
            pose = pose.moved(Pose(way_m, 0.0, turn_rad))
        assert move.said < MOST_MOVES
        assert pose.way_to(goal).way_m < 0.1
        assert abs(math.remainder(pose.yaw_rad - goal.yaw_rad, math.tau)) < math.radians(8)
