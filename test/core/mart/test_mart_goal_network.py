# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of goals on a network that loses, delays and duplicates datagrams."""

import math
from random import Random
from typing import Any

import pytest
from honesty import RARE, nees
from mart_bench import MartBench
from mart_goals import EVERY_FIRMWARE, drops, holds_command, on, random_goal, reach, yaw_error

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.mart import MartSettings as Settings
from omnibot_driver.core.mart.states import Motion, State
from omnibot_driver.core.packets import Packet
from omnibot_driver.simulator.common.network import NetworkFaults
from omnibot_driver.simulator.mart import Firmware

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(("seed", "firmware"), list(enumerate(EVERY_FIRMWARE)))
def test_goals_are_reached_although_datagrams_take_up_to_a_tenth_of_a_second(
    seed: int, firmware: Firmware
) -> None:
    """Replies come up to 0.1 s late and in another order. The robot still reaches each goal.

    The driver does not mistake the delays for a duplicated move.
    """
    bench, random = on(NetworkFaults(delay_s=0.1), firmware, seed), Random(seed)
    for _ in range(2):
        goal = random_goal(random)
        assert reach(bench, goal) == ""
        assert bench.truth.way_to(goal).way_m < 0.12
        assert bench.error.way_m < 0.1


@pytest.mark.parametrize("seed", range(4))
def test_a_goal_comes_to_an_end_although_a_quarter_of_all_datagrams_is_lost(seed: int) -> None:
    """The network loses a quarter of all datagrams.

    The goal is still reached or discarded, because the driver's wait for late HELLOs (name queries)
    before a move is limited.
    """
    bench = on(NetworkFaults(lose=0.25, delay_s=0.01), EVERY_FIRMWARE[seed % 3], seed)
    reach(bench, Pose(0.6, 0.3, 1.5))


def test_a_goal_that_another_cause_ends_is_noticed() -> None:
    """The tests' function ``reach`` returns within 30 s if the e-stop ends the goal.

    The driver does not report this end.
    """
    bench = MartBench("source").ready()

    def latches(data: bytes) -> bool:
        if data.startswith(b"TF"):
            bench.session.estop(True, bench.now)
        return False

    drops(bench.robot.network[0].to_board, latches)
    began_s = bench.now
    reach(bench, Pose(0.5, 0.0, 0.0))
    assert bench.now - began_s < 30.0
    assert not holds_command(bench)


def test_a_goal_that_is_cancelled_in_its_wait_does_not_shorten_the_next_wait() -> None:
    """A goal is cancelled while its move waits for a late HELLO (name query).

    The move of the next goal also waits, with the same limit of 2 s.
    """
    bench = MartBench("source").ready()
    bench.go_to(0.3, 0.0, 0.0)
    bench.run_until(lambda: bench.server.chassis.way_m > 0.1, 10.0)
    bench.command(0.0, 0.0, 3.0)
    pilot = bench.board._pilot
    for _ in range(2):
        pilot._greeted_s = bench.now
        since = len(bench.written)
        bench.go_to(0.8, 0.0, 0.0)
        bench.run(0.2)
        assert not any(text.startswith((b"TF", b"MCR", b"MCL")) for text in bench.said(since))
        bench.command(0.0, 0.0, 3.0)


def test_losses_end_few_goals_and_the_odometry_stays_right() -> None:
    """If a tenth of all datagrams is lost, at most one of twelve goals is discarded.

    The covariance covers the error of the odometry.
    """
    discarded = 0
    for seed in range(4):
        bench, random = (
            on(NetworkFaults(lose=0.1, delay_s=0.05), EVERY_FIRMWARE[seed % 3], seed),
            Random(seed),
        )
        for _ in range(3):
            goal = random_goal(random)
            discarded += "discarded" in reach(bench, goal)
            covariance = bench.odometry[-1].covariance
            assert bench.error.way_m < 0.1 + 2 * (covariance.xx + covariance.yy) ** 0.5
            assert yaw_error(bench) < 0.2 + 2 * covariance.yaw_yaw**0.5
    assert discarded <= 1


def test_duplicated_moves_end_few_goals_and_the_odometry_stays_right() -> None:
    """If a tenth of all datagrams arrives twice, few goals are discarded.

    The driver stops the second run of a move. The covariance covers the error of the odometry.
    """
    said = ""
    for seed in (0, 1, 5, 6, 10, 11):
        network = NetworkFaults(duplicate=0.1, delay_s=0.05)
        bench, random = on(network, EVERY_FIRMWARE[seed % 3], seed), Random(seed)
        for _ in range(3):
            said += reach(bench, random_goal(random))
            covariance = bench.odometry[-1].covariance
            assert bench.error.way_m < 0.1 + 2 * (covariance.xx + covariance.yy) ** 0.5
            assert yaw_error(bench) < 0.2 + 2 * covariance.yaw_yaw**0.5
    assert said.count("delivered a controlled move twice") >= 4
    assert said.count("discarded") <= 2


def twice_once(bench: MartBench, word: bytes, later_s: float) -> list[bytes]:
    """Let the network duplicate the next ``word`` command; the copy comes ``later_s`` later.

    Return a list. It is empty until the driver sends this command, and then contains the command.
    """
    path = bench.robot.network[0].to_board
    real, moves = path.send, list[bytes]()

    def send(data: bytes, at_s: float) -> None:
        real(data, at_s)
        if data.startswith(word) and not data.endswith(b" 0") and not moves:
            moves.append(data)
            real(data, at_s + later_s)

    path.send = send  # type: ignore[method-assign]
    return moves


@pytest.mark.parametrize(
    ("degrees", "delay_s", "firmware"),
    [
        (degrees, delay_s, EVERY_FIRMWARE[(n + m + k) % 3])
        for n, degrees in enumerate((12, 15, 18, 25, 60))
        for m, delay_s in enumerate((0.05, 0.3))
        for k in range(2)
    ],
)
def test_a_turn_that_runs_twice_is_counted_twice_or_uncertain(
    degrees: float, delay_s: float, firmware: Firmware
) -> None:
    """The server runs a turn twice. The driver stops the second run, or is too late to stop it.

    In both cases, the covariance covers the error of the heading.
    """
    settings = Settings(network_delay_s=delay_s)
    bench = MartBench(firmware, settings=settings).ready()
    moves = twice_once(bench, b"MC", 0.02)
    bench.go_to(0.0, 0.0, math.radians(degrees))
    bench.run_until(lambda: bool(moves) and bench.board._pilot._last_move is None, 20.0)
    bench.run(0.1)
    assert yaw_error(bench) < 0.05 + 3 * bench.odometry[-1].covariance.yaw_yaw ** 0.5


@pytest.mark.parametrize("word", [b"TF", b"MC"])
@pytest.mark.parametrize("later_s", [0.1, 0.3])
def test_a_reset_of_the_odometry_after_a_move_that_runs_twice_adds_nothing_from_before(
    word: bytes, later_s: float
) -> None:
    """A move runs twice. The user resets the odometry before the driver reads the encoder.

    The pose after the reset contains no motion of the first run.
    """
    bench = on(NetworkFaults(), "source")
    reach(bench, Pose(0.6, 0.0, 0.0))
    moves = twice_once(bench, word, 0.02)
    bench.go_to(*((1.8, 0.0, 0.0) if word == b"TF" else (0.6, 1.2, math.pi / 2)))
    pilot = bench.board._pilot
    bench.run_until(lambda: bool(moves) and pilot.motion is Motion.NONE, 20.0)
    bench.run(later_s)
    bench.session.reset_odometry(bench.now)
    bench.settle()
    origin = bench.truth
    bench.run(4.0)
    pose, covariance = bench.odometry[-1].pose, bench.odometry[-1].covariance
    moved = origin.way_to(bench.truth)
    error = Pose(pose.x_m - moved.x_m, pose.y_m - moved.y_m, pose.yaw_rad - moved.yaw_rad)
    assert error.way_m < 0.05 + 2 * (covariance.xx + covariance.yy) ** 0.5
    turn_rad = abs(math.remainder(error.yaw_rad, math.tau))
    assert turn_rad < 0.1 + 2 * covariance.yaw_yaw**0.5


def test_the_first_move_of_an_uncalibrated_robot_is_not_taken_for_half_a_move() -> None:
    """A robot's first move goes half as far as requested, and the queries after it are lost.

    The driver does not assume that the network duplicated the move, and the odometry stays right.
    """
    bench = MartBench("source", speed_mps_per_unit=0.0039).ready()
    bench.go_to(1.0, 0.0, 0.0)
    pilot, network = bench.board._pilot, bench.robot.network[0]
    quiet = (b"ENC", b"HELLO", b"RMRA")

    def lost(data: bytes) -> bool:
        rests = pilot.state is State.STILL and pilot._last_move is not None
        return rests and data in quiet and bench.now < pilot._rested_s + 0.7

    assert drops(network.to_board, lost) == []
    drops(network.from_board, lambda data: data == b"ok BBB" and pilot._last_move is not None)
    bench.run_until(lambda: pilot._last_move is not None, 20.0)
    bench.run_until(lambda: pilot._last_move is None, 25.0)
    bench.run(1.0)
    assert b"SL" in bench.said()
    assert bench.error.way_m < 0.1


@pytest.mark.parametrize("firmware", EVERY_FIRMWARE)
def test_a_move_whose_reply_is_lost_is_counted_from_its_start(firmware: Firmware) -> None:
    """A controlled turn's reply is lost, and the reply to a stop shows that the turn is complete.

    The odometry uses the whole encoder count, which began at zero with the turn.
    """
    bench = on(NetworkFaults(), firmware)
    reach(bench, Pose(0.15, 0.0, 0.0))

    def ends_a_turn(data: bytes) -> bool:
        last = bench.said()[-1]
        return data == b"ok" and last.startswith(b"MC") and not last.endswith(b" 0")

    lost = drops(bench.robot.network[0].from_board, ends_a_turn)
    reach(bench, Pose(0.15, 0.5, 0.0))
    assert lost
    assert bench.error.way_m < 0.05
    assert yaw_error(bench) < 0.05


def test_a_turn_whose_heading_was_not_read_is_not_added_to_the_drive_after_it() -> None:
    """The robot turns, then drives straight, and the driver reads the heading only after the drive.

    The odometry has added the turn by the encoder count, and does not add the turn again.
    """
    bench = on(NetworkFaults(), "documented")
    reach(bench, Pose(0.0, 0.6, math.pi / 2))
    turns = [data for data in bench.said() if data.startswith(b"MC") and data != b"MCR SLOW 0"]
    assert turns
    assert bench.error.way_m < 0.05
    assert yaw_error(bench) < 0.05


@pytest.mark.parametrize("firmware", ["documented", "firmware", "source"])
def test_a_lost_count_after_a_move_does_not_end_the_goal(firmware: Firmware) -> None:
    """The first reply to the encoder query (ENC) after each move is lost, but HELLO is answered.

    The driver then repeats ENC, and the robot reaches the goal.
    """
    bench, counted = on(NetworkFaults(), firmware), set[int]()

    def is_first_count(data: bytes) -> bool:
        moves = sum(each[:2] in (b"TF", b"MC") for each in bench.said())
        ended = bench.board._pilot._moved_by is not None and bench.robot.stands
        first = ended and bench.written[-1][1] == b"ENC" and moves not in counted
        counted.update({moves} if first else ())
        return first

    lost = drops(bench.robot.network[0].from_board, is_first_count)
    assert reach(bench, Pose(1.0, 0.5, 0.0)) == ""
    assert bench.truth.way_to(Pose(1.0, 0.5, 0.0)).way_m < 0.1
    assert len(lost) >= 2


@pytest.mark.parametrize("firmware", EVERY_FIRMWARE)
def test_a_suspected_copy_that_the_count_excludes_does_not_end_the_goal(firmware: Firmware) -> None:
    """A suspected copy of a turn does not end the goal if the encoder count fits a single run."""
    bench = on(NetworkFaults(), firmware)
    pilot = bench.board._pilot

    def soon_after_the_first_turn(data: bytes) -> bool:
        soon = 0.0 < bench.now - pilot._rested_s < 0.3 or data == b"ok BBB"
        return soon and pilot._move is not None and pilot._move.said == 1

    drops(bench.robot.network[0].from_board, soon_after_the_first_turn)
    assert reach(bench, Pose(0.0, 0.5, math.pi / 2)) == ""
    assert b"SS" in bench.said()
    assert bench.truth.way_to(Pose(0.0, 0.5, 0.0)).way_m < 0.1
    assert bench.error.way_m < 0.05


def test_a_hello_sent_before_a_move_does_not_hide_a_copy_of_the_move() -> None:
    """An answer to a HELLO sent before a move does not prove that no copy of the move runs.

    The server answers HELLO before it runs the copy. The driver stops the copy.
    """
    bench = MartBench("source").ready()
    network, late = bench.robot.network[0], list[bytes]()

    def send(data: bytes, at_s: float, real: Any = network.to_board.send) -> None:
        if data == b"HELLO" and bench.written[-2][1] == b"RST IMU":
            late.append(data)
            return
        real(data, at_s)
        if data == b"MCL SLOW 90":
            real(late[-1], at_s + 0.02)
            real(data, at_s + 0.1)

    def reply(data: bytes, at_s: float, real: Any = network.from_board.send) -> None:
        checked = b"MCL SLOW 90" not in bench.said() and data == b"ok"
        real(data, at_s + 0.25 if checked else at_s)

    network.to_board.send, network.from_board.send = send, reply
    bench.go_to(0.0, 0.0, math.pi / 2)
    bench.run(10.0)
    assert bench.robot.stands
    assert math.pi / 2 < bench.truth.yaw_rad < 0.75 * math.pi
    assert b"SS" in bench.said()


def test_a_late_answer_to_hello_does_not_hide_a_copy_of_the_move() -> None:
    """The network duplicates a move, and an old answer to HELLO (name query) arrives late.

    The answer seems to show that no move runs, but the driver stops the second run.
    """
    bench = on(NetworkFaults(), "source")
    network = bench.robot.network[0]

    def send(data: bytes, at_s: float, real: Any = network.to_board.send) -> None:
        real(data, at_s)
        if data == b"MCL SLOW 90":
            real(data, at_s + 0.2)
            network.from_board.send(b"ok BBB", at_s + 0.5)

    network.to_board.send = send  # type: ignore[method-assign]
    bench.go_to(0.0, 0.0, math.pi / 2)
    bench.run(10.0)
    assert bench.robot.stands
    assert math.pi / 2 < bench.truth.yaw_rad < 0.75 * math.pi
    assert b"SS" in bench.said()


@pytest.mark.parametrize("cut_s", [0.7, 1.3, 2.0, 2.4, 2.8, math.inf])
@pytest.mark.parametrize("goal", [Pose(0.0, 0.0, 2.8), Pose(1.0, 0.0, 0.0)])
def test_a_second_run_whose_first_reply_is_lost_makes_the_odometry_uncertain(
    goal: Pose, cut_s: float
) -> None:
    """A move is duplicated, and its first reply is lost.

    The encoder counts only the second run, so the odometry lacks the first run, and the covariance
    fits the error.
    """
    bench = MartBench("source").ready()
    to_board, from_board = bench.robot.receive, bench.robot.advance
    copied = lost = False

    def receive(data: bytes, now: float, channel: int) -> None:
        nonlocal copied
        to_board(data, now, channel)
        if data.startswith((b"MC", b"TF")) and not copied:
            copied = True
            to_board(data, now, channel)

    def advance() -> list[Packet]:
        nonlocal lost
        kept: list[Packet] = []
        for packet in from_board():
            if copied and not lost and packet[1].startswith(b"ok"):
                lost = True
            else:
                kept.append(packet)
        return kept

    vars(bench.robot).update(receive=receive, advance=advance)
    bench.go_to(goal.x_m, goal.y_m, goal.yaw_rad)
    bench.run_until(lambda: lost, 20.0)
    bench.run(min(cut_s, 30.0))
    bench.command(0.0, 0.0, 4.0)
    assert nees(bench) < RARE
