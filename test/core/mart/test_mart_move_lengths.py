# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the length and the speed of the moves that the driver requests on the way to a goal.

The server's moves go too far, so the driver requests less.
"""

import math
from random import Random

import pytest
from mart_bench import MartBench
from mart_goals import first_distance

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.mart import MartSettings
from omnibot_driver.core.mart.goal import INCH_M, MOST_MOVES, STRETCH, Move, Surplus, next_move
from omnibot_driver.core.mart.jobs import Job
from omnibot_driver.core.mart.words import MCR, TB, TF

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("beyond_deg", [0.0, 3.0, 6.0, 9.0])
def test_small_turns_that_go_beyond_do_not_use_up_the_moves(beyond_deg: float, seed: int) -> None:
    """The robot reaches each goal in fewer than ``MOST_MOVES`` moves, although moves go too far.

    Turns go up to 10° too far, and drives 15 % to 30 %.
    """
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


@pytest.mark.parametrize(
    ("limits", "turn", "way"),
    [
        ({}, b"MCL SLOW 90", b"TF 30"),
        ({"max_yaw_rate_radps": 1.5}, b"MCL 90", b"TF 30"),
        ({"max_speed_mps": 0.1}, b"MCL SLOW 90", b"TF SLOW 30"),
    ],
    ids=["defaults", "a fast turn", "a slow drive"],
)
def test_a_move_is_slow_if_the_normal_one_is_faster_than_the_limits(
    limits: dict[str, float], turn: bytes, way: bytes
) -> None:
    """The driver requests a SLOW move if a normal one would exceed the speed limits.

    A normal move drives at 0.26 m/s or turns at 1.3 rad/s.
    """
    settings, surplus = MartSettings(**limits), Surplus()
    to_the_left = next_move(Move(Pose(0.0, 1.0, 0.0)), Pose(), settings, surplus)
    ahead = next_move(Move(Pose(30 * INCH_M * STRETCH, 0.0, 0.0)), Pose(), settings, surplus)
    assert to_the_left is not None
    assert ahead is not None
    assert (to_the_left.data, ahead.data) == (turn, way)


def test_a_move_that_an_obstacle_ends_does_not_make_the_next_one_longer() -> None:
    """An obstacle ends a move early. The driver learns nothing from this move.

    So it does not request a longer distance for the next one.
    """
    bench = MartBench(front_m=0.7).ready()
    first_distance(bench, 2.0)
    bench.run_until(lambda: any("clearance" in notice for notice in bench.notices), 10.0)
    bench.run(2.0)
    here_m = bench.truth.x_m
    assert 0.05 < here_m < 0.7
    assert first_distance(bench, here_m - 2.0) <= round(2.0 / INCH_M / STRETCH) + 1


def test_a_move_that_the_dock_ends_does_not_make_the_next_one_longer() -> None:
    """A docking move that the dock ends early does not make the move to the next goal longer."""
    bench = MartBench(dock_m=0.2).ready()
    assert bench.job(Job.DOCK, "DOCK", 40).success
    bench.run(2.0)
    assert first_distance(bench, -1.8) <= round(2.0 / INCH_M / STRETCH) + 1


def test_a_copy_of_a_move_that_was_stopped_teaches_no_length_and_is_added_to_the_way() -> None:
    """The network delivers a move twice, and the driver stops the second run.

    The odometry contains both runs. The driver does not use this move to learn the lengths of
    moves.
    """
    bench = MartBench().ready()
    bench.go_to(0.8, 0.0, 0.0)
    bench.run(12.0)
    surplus = bench.board._pilot._surplus
    inches, since = surplus.inches(2.0, slow=False), len(bench.written)
    first_distance(bench, 2.8)
    move = next(data for data in bench.said(since) if data.startswith(b"TF"))
    bench.server.receive(move, 0, "driver", bench.robot.board.now_s)
    bench.run(30.0)
    assert any("delivered a controlled move twice" in notice for notice in bench.notices)
    assert not any("discarded" in notice for notice in bench.notices)
    assert bench.error.way_m < 0.25
    assert bench.odometry[-1].pose.x_m == pytest.approx(2.8, abs=0.1)
    assert surplus.inches(2.0, slow=False) == inches
