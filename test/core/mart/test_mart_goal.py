# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of goals: when they are begun, repeated, replaced, reached, given up or refused."""

import math

import pytest
from mart_bench import MartBench

from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.mart import MartSettings
from omnibot_driver.core.mart.goal import MOST_MOVES
from omnibot_driver.core.mart.jobs import Job
from omnibot_driver.simulator.common.network import NetworkFaults
from omnibot_driver.simulator.mart import Firmware

pytestmark = pytest.mark.slow


def end(bench: MartBench) -> None:
    bench.run(1.0)
    for _ in range(20):
        bench.until_it_stands(60.0)
        bench.run(3.0)
        if bench.robot.stands:
            return


@pytest.mark.parametrize("firmware", ["documented", "firmware"])
@pytest.mark.parametrize("step", [Pose(0.0, 0.0, math.pi / 2), Pose(0.5, 0.0, 0.0)], ids=str)
def test_equal_moves_in_a_row_are_all_counted(step: Pose, firmware: Firmware) -> None:
    """The odometry adds every move, although equal moves may end with the same encoder count."""
    bench, goal = MartBench(firmware).ready(), Pose()
    for _ in range(4):
        goal = goal.moved(step)
        bench.go_to(goal.x_m, goal.y_m, goal.yaw_rad)
        end(bench)
        assert bench.error.way_m < 0.1
        assert abs(math.remainder(bench.error.yaw_rad, math.tau)) < 0.15
        assert bench.truth.way_to(goal).way_m < 0.2


@pytest.mark.parametrize("every_s", [2.0, 1.0, 0.2])
def test_a_goal_that_is_repeated_is_reached_as_if_it_was_given_once(every_s: float) -> None:
    """A program such as ``ros2 topic pub`` repeats a goal at regular intervals.

    The driver begins the goal only once.
    """
    once, repeated = MartBench().ready(), MartBench().ready()
    for _ in range(round(20.0 / every_s)):
        repeated.go_to(1.0, 0.5, 0.0)
        repeated.run(every_s)
    once.go_to(1.0, 0.5, 0.0)
    end(once)
    end(repeated)
    moves = [
        [data for data in bench.said() if data[:2] in (b"TF", b"MC")] for bench in (once, repeated)
    ]
    assert moves[0] == moves[1]
    assert repeated.truth.way_to(Pose(1.0, 0.5, 0.0)).way_m < 0.1


@pytest.mark.parametrize("firmware", ["documented", "firmware"])
def test_a_goal_that_is_replaced_within_a_move_is_followed_by_the_next_at_once(
    firmware: Firmware,
) -> None:
    """A new goal interrupts the move to the old goal. The next move begins within 1.6 s."""
    bench = MartBench(firmware).ready()
    assert bench.job(Job.LOG).success
    bench.go_to(2.0, 0.0, 0.0)
    bench.run(3.0)
    since, from_s = len(bench.written), bench.now
    bench.go_to(0.0, 1.0, 0.0)
    bench.run_until(lambda: any(data[:2] == b"MC" for data in bench.said(since)), 10.0)
    assert bench.now - from_s < 1.6
    assert not bench.board._pilot.jobs.log_may_be_lost
    end(bench)
    assert bench.error.way_m < 0.1


@pytest.mark.parametrize("firmware", ["documented", "firmware", "source"])
def test_a_repeated_goal_ends_the_move_of_a_docking(firmware: Firmware) -> None:
    """During a docking, the user repeats the goal that was commanded before the docking.

    This command cancels the docking: the driver stops the move to the dock at once.
    """
    bench = MartBench(firmware).ready()
    bench.go_to(0.0, 0.0, 0.0)
    bench.run(2.0)
    bench.board.ask(Job.DOCK, "token", bench.now, "DOCK", 12)
    bench.run_until(lambda: bench.truth.x_m > 0.05, 5.0)
    bench.go_to(0.0, 0.0, 0.0)
    bench.run(3.0)
    assert bench.truth.x_m < 0.12


def test_a_goal_that_is_not_reached_is_given_up_with_a_notice() -> None:
    """The network loses every straight move, so the robot does not reach its goal.

    After ``MOST_MOVES`` moves, the driver discards the goal. A notice says how far away the goal
    is.
    """
    bench = MartBench().ready()
    receive = bench.robot.receive
    bench.robot.receive = lambda data, now, channel: (  # type: ignore[method-assign]
        None if data.startswith(b"TF") else receive(data, now, channel)
    )
    bench.go_to(0.5, 0.0, 0.0)
    bench.run(60.0)
    assert sum(data.startswith(b"TF") for data in bench.said()) == MOST_MOVES
    assert any("goal not reached after 9 moves: 0.50 m" in notice for notice in bench.notices)


def test_a_straight_move_that_is_too_long_for_the_server_does_not_use_up_the_moves() -> None:
    """The goal is 30 m away, and the first move is stopped after 80 s (about 20 m).

    The driver then counts the moves from zero again, and the robot reaches the goal.
    """
    bench = MartBench().ready()
    bench.go_to(30.0, 0.0, 0.0)
    bench.run_until(lambda: sum(data.startswith(b"TF") for data in bench.said()) == 2, 100.0)
    assert bench.board._pilot.goal_progress.startswith("move 1, ")
    bench.run_until(lambda: bench.board._pilot.goal_progress.startswith("over"), 100.0)
    bench.run(0.2)
    assert bench.odometry[-1].pose.x_m == pytest.approx(30.0, abs=0.1)


@pytest.mark.parametrize("x_m", [1e4, 1e9, 1e60, 1e308, -1e300])
def test_a_goal_that_no_command_can_express_is_refused(x_m: float) -> None:
    """A goal that is farther away than 1000 m is rejected, and a later goal still moves the robot.

    The command of a farther goal could be too long.
    """
    bench = MartBench().ready()
    with pytest.raises(CommandRefused, match="the limit is 1000 m"):
        bench.session.command_pose(Pose(x_m, 0.0, 0.0), bench.now)
    bench.settle()
    bench.run(3.0)
    assert bench.server.chassis.way_m == 0.0
    bench.go_to(0.5, 0.0, 0.0)
    bench.run(3.0)
    assert bench.server.chassis.way_m > 0.0


@pytest.mark.parametrize(
    ("goal", "faults"),
    [
        ((2.0, 0.0, 0.0), NetworkFaults()),
        ((2.0, 0.0, 0.0), NetworkFaults(lose=0.1, delay_s=0.05)),
        ((30.0, 0.0, 0.0), NetworkFaults()),
        ((0.0, 2.0, 0.0), NetworkFaults()),
    ],
)
def test_a_goal_ends_after_a_move_in_which_the_wheel_counts_the_wrong_way(
    goal: tuple[float, float, float], faults: NetworkFaults
) -> None:
    """The encoder counts down while the robot drives forward, so each move seems to lead away.

    The driver discards the goal after the first move. A notice names the parameter
    ``encoder_inverted``.
    """
    bench = MartBench(faults=faults, encoder_sign=-1).ready()
    bench.go_to(*goal)
    bench.run(20.0 + 2.5 * goal[0])
    moves = [data for data in bench.said() if data.split()[0] in (b"TF", b"TB", b"MCR", b"MCL")]
    assert len(moves) == 1
    assert bench.robot.stands
    assert any("`encoder_inverted`" in notice for notice in bench.notices)


@pytest.mark.parametrize("firmware", ["firmware", "source", "documented"])
def test_a_turn_of_a_slow_robot_is_not_taken_for_two_runs(firmware: Firmware) -> None:
    """A long turn of a slow robot is not taken for two runs of the turn.

    ``linear_scale`` says that the robot is half as fast as usual.
    """
    settings = MartSettings(speed_per_unit=0.004)
    bench = MartBench(firmware, settings=settings, speed_mps_per_unit=0.004).ready()
    bench.go_to(0.0, 0.0, 2.8)
    bench.run(20.0)
    assert bench.board._pilot.goal_progress.startswith("over")
    assert bench.odometry[-1].covariance.yaw_yaw < 0.05**2
