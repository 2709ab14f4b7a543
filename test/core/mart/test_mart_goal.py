# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that goals are reached although the server's moves go farther than requested."""

import math
from random import Random

import pytest
from mart_bench import MartBench

from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.mart import MartSettings
from omnibot_driver.core.mart.goal import INCH_M, MOST_MOVES, STRETCH, Move, Surplus, next_move
from omnibot_driver.core.mart.jobs import Job
from omnibot_driver.core.mart.states import Motion
from omnibot_driver.core.mart.words import MCR, TB, TF
from omnibot_driver.core.packets import Packet
from omnibot_driver.simulator.common.network import NetworkFaults
from omnibot_driver.simulator.mart import Firmware

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("beyond_deg", [0.0, 3.0, 6.0, 9.0])
def test_small_turns_that_go_beyond_do_not_use_up_the_moves(beyond_deg: float, seed: int) -> None:
    """The robot turns up to 10° farther than requested, and drives 15 % to 30 % too far.

    The driver learns this and requests less. So it reaches each goal in fewer than MOST_MOVES
    moves.
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
    """The driver makes several equal moves, and many of them end with the same encoder count.

    An equal count could be an old one, from the move before. Nevertheless, the odometry adds the
    motion of every move.
    """
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
    """While the robot makes a move to a goal, the user gives a new goal.

    When the server has replied to this move, the driver begins the first move to the new goal at
    once.
    """
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


def lose_and_copy_a_check(bench: MartBench, lost: tuple[bytes, ...]) -> None:
    """Change the network so that it loses some commands and duplicates the next RST IMU.

    ``lost``: the network loses each command that begins with one of these words. The copy of RST
    IMU arrives 0.29 s late. The reply to this copy is delayed by 0.29 s, too.
    """
    receive, advance, board = bench.robot.receive, bench.robot.advance, bench.robot.board
    copies: list[float] = []
    replies: list[float] = []

    def lossy(data: bytes, now: float, channel: int) -> None:
        if data.startswith(b"RST IMU") and not copies:
            copies.append(board.now_s + 0.29)
        if not data.startswith(lost):
            receive(data, now, channel)

    def late() -> list[Packet]:
        if copies and copies[0] <= board.now_s:
            receive(b"RST IMU", board.now_s, 0)
            copies[0] = math.inf
        out: list[Packet] = []
        for packet in advance():
            if packet[1] == b"ok" and copies == [math.inf]:
                replies.append(board.now_s + 0.29)
            else:
                out.append(packet)
        due = [at for at in replies if at <= board.now_s]
        replies[:] = [at for at in replies if at > board.now_s]
        return out + [(0, b"ok")] * len(due)

    bench.robot.receive = lossy  # type: ignore[method-assign]
    bench.robot.advance = late  # type: ignore[method-assign]


@pytest.mark.parametrize(
    ("firmware", "before", "stops_s"),
    [
        (firmware, ((0.0, 0.5), (0.25, 0.0))[(n + m) % 2], stops_s)
        for n, firmware in enumerate(("firmware", "source"))
        for m, stops_s in enumerate((0.1, 0.3, None))
    ],
)
def test_a_late_ok_of_the_check_does_not_confirm_a_move_that_was_lost(
    firmware: Firmware, before: tuple[float, float], stops_s: float | None
) -> None:
    """The command for the turn to a goal is lost. Then the late ok to an IMU check arrives.

    The driver must not take this ok for the reply to the turn command. The encoder still shows the
    count of the previous motion, and the odometry does not add this count again.
    """
    bench = MartBench(firmware).ready()
    bench.command(*before, 3.0)
    bench.command(0.0, 0.0, 1.5)
    lose_and_copy_a_check(bench, (b"MC",))
    here = bench.odometry[-1].pose
    bench.go_to(here.x_m, here.y_m, here.yaw_rad - 2.0)
    bench.run_until(lambda: bench.board._pilot.motion is Motion.TURN, 5.0)
    bench.run(stops_s or 3.0)
    bench.command(0.0, 0.0, 3.0)
    assert bench.error.way_m < 0.05
    assert abs(bench.error.yaw_rad) < 0.05


@pytest.mark.parametrize("firmware", ["firmware", "source"])
def test_a_late_ok_of_the_check_does_not_confirm_a_drive_that_was_lost(firmware: Firmware) -> None:
    """The command of a backward drive is lost. Then a late ok arrives, the reply to an IMU check.

    The ok looks like a reply to the command. The driver does not trust it, because the network has
    duplicated replies a short time before. So the odometry adds no motion.
    """
    bench = MartBench(firmware).ready()
    bench.command(-0.2, 0.0, 3.0)
    replies = bench.robot.network[0].from_board
    replies._faults = NetworkFaults(duplicate=1.0)
    bench.command(0.0, 0.0, 3.0)
    replies._faults = NetworkFaults()
    receive = bench.robot.receive
    lose_and_copy_a_check(bench, (b"B", b"ENC"))
    bench.command(-0.2, 0.0, 1.0)
    bench.robot.receive = receive  # type: ignore[method-assign]
    bench.command(0.0, 0.0, 4.0)
    assert bench.error.way_m < 0.05


def first_distance(bench: MartBench, x_m: float) -> int:
    """Command a goal ahead or behind, and return the first requested distance, in inches."""
    since = len(bench.written)
    bench.go_to(x_m, 0.0, 0.0)

    def straight() -> list[bytes]:
        return [data for data in bench.said(since) if data.startswith(b"TF")]

    bench.run_until(lambda: bool(straight()), 30.0)
    return int(straight()[0].split()[-1])


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
    """The dock ends a move early. The driver must not learn from this that moves are short.

    The next goal is behind the robot. On the way to it, the driver requests the usual distance.
    """
    bench = MartBench(dock_m=0.2).ready()
    assert bench.job(Job.DOCK, "DOCK", 40).success
    bench.run(2.0)
    assert first_distance(bench, -1.8) <= round(2.0 / INCH_M / STRETCH) + 1


def test_a_copy_of_a_move_that_was_stopped_teaches_no_length_and_is_added_to_the_way() -> None:
    """The server executes a straight move. Then a late copy of the command begins a second run.

    The driver stops the second run. The encoder then shows only the distance of the second run. So
    the driver adds the distance of the first run, which it knows from earlier moves. Then the robot
    continues to the goal. The driver does not learn from the stopped run how far a move goes.
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


def test_a_goal_that_is_not_reached_is_given_up_with_a_notice() -> None:
    """The network loses every straight move to a goal, so the robot stays where it is.

    After MOST_MOVES moves, the driver gives the goal up, and says how far away it is.
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
    """A goal is 30 m away. After 80 s, or about 20 m, the driver stops the straight move.

    From then on, the driver counts the moves to this goal from zero again. So the robot can reach a
    goal at any distance, although the number of moves to a goal is limited.
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
    """A goal is farther away than 1000 m, so the driver rejects it.

    A later goal still moves the robot. The limit exists because the command for a farther goal
    could be too long for a request.
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
    """The robot is half as fast as usual, and `linear_scale` says so. The network is good.

    A turn takes long, but the driver does not conclude that it may have run twice.
    """
    settings = MartSettings(speed_per_unit=0.004)
    bench = MartBench(firmware, settings=settings, speed_mps_per_unit=0.004).ready()
    bench.go_to(0.0, 0.0, 2.8)
    bench.run(20.0)
    assert bench.board._pilot.goal_progress.startswith("over")
    assert bench.odometry[-1].covariance.yaw_yaw < 0.05**2
