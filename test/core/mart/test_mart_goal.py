# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Goals are reached although controlled moves go beyond what was requested."""

import math
from random import Random

import pytest
from mart_bench import MartBench

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.mart import MartSettings
from omnibot_driver.core.mart.goal import INCH_M, MOST_MOVES, STRETCH, Move, Surplus, next_move
from omnibot_driver.core.mart.jobs import Job
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


def first_distance(bench: MartBench, x_m: float) -> int:
    """Command a goal straight ahead or behind; return the number of inches first requested."""
    since = len(bench.written)
    bench.go_to(x_m, 0.0, 0.0)

    def straight() -> list[bytes]:
        return [data for data in bench.said(since) if data.startswith(b"TF")]

    bench.run_until(lambda: bool(straight()), 30.0)
    return int(straight()[0].split()[-1])


def test_a_move_that_an_obstacle_ends_does_not_make_the_next_one_longer() -> None:
    """It was cut short, so its distance does not show how far the robot drives by an inch."""
    bench = MartBench(front_m=0.7).ready()
    first_distance(bench, 2.0)
    bench.run_until(lambda: any("clearance" in notice for notice in bench.notices), 10.0)
    bench.run(2.0)
    here_m = bench.truth.x_m
    assert 0.05 < here_m < 0.7
    assert first_distance(bench, here_m - 2.0) <= round(2.0 / INCH_M / STRETCH) + 1


def test_a_move_that_the_dock_ends_does_not_make_the_next_one_longer() -> None:
    """The next goal is behind; its straight move is that of a driver that has never docked."""
    bench = MartBench(dock_m=0.2).ready()
    assert bench.job(Job.DOCK, "DOCK", 40).success
    bench.run(2.0)
    assert first_distance(bench, -1.8) <= round(2.0 / INCH_M / STRETCH) + 1


def test_a_copy_of_a_move_that_was_stopped_teaches_no_length_and_ends_the_goal() -> None:
    """The count covers only the copy, so where the robot is now is not known."""
    bench = MartBench().ready()
    first_distance(bench, 2.0)
    (move,) = [data for data in bench.said() if data.startswith(b"TF")]
    bench.server.receive(move, 0, "driver", bench.robot.board.now_s)
    bench.run(30.0)
    assert any("the goal of cmd_pose is discarded" in notice for notice in bench.notices)
    assert bench.truth.x_m < 2.4
    assert bench.board._pilot._surplus.inches(2.0)[0] <= round(2.0 / INCH_M / STRETCH) + 1
