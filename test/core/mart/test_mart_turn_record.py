# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The driver takes the angle of a controlled turn from the server's record of the turn.

Some servers keep no such records.
"""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mart_bench import MartBench

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.mart.incoming_file import PIECE
from omnibot_driver.core.mart.jobs import Job
from omnibot_driver.core.mart.turn_record import MOST, UNRECORDED, recorded_deg
from omnibot_driver.core.mart.words import MCL, MCR
from omnibot_driver.simulator.mart import files
from omnibot_driver.simulator.mart.board import TICK_S
from omnibot_driver.simulator.mart.motion import Kind

RECORD = (
    b"MC Spin sensor data log\n"
    b"11/27/2026  1:25:13\n"
    b"Target motion (\xb0): 90.00\n"
    b"Calculated motion (\xb0):\n"
    b"  @ stop detected - -91.73\n"
    b"  @ encoder stop - -91.43\n"
    b"Gyro bias (deg/sec): 0.000\n"
    b"Max speed: 20\n"
)
"""The first lines of the record that the public server writes about a turn to the right."""
LONGEST_REPLY = 100
GOALS = [(1.0, 1.0, 3.0), (-1.0, 0.5, -2.0), (0.5, -1.0, 1.5), (0.0, 0.0, 0.0)]


def go(bench: MartBench, goal: Pose) -> None:
    """Command the goal, and wait until the diagnostics show that it is over."""
    bench.go_to(goal.x_m, goal.y_m, goal.yaw_rad)
    bench.run_until(lambda: bench.board.figures.own["Goal"].startswith("over"), 120.0)


def lose_once(bench: MartBench, begins: bytes) -> None:
    """Let the network lose the next datagram that begins with ``begins``, in either direction."""
    lost: list[bytes] = []
    for way in (bench.robot.network[0].to_board, bench.robot.network[0].from_board):

        def send(data: bytes, at_s: float, real: Any = way.send) -> None:
            if data.startswith(begins) and not lost:
                lost.append(data)
            else:
                real(data, at_s)

        way.send = send


def copy_late(bench: MartBench, request: bytes, after_s: float, late_s: float) -> list[float]:
    """Let the network duplicate the next ``request``, and delay files after the duplicate.

    The returned list gets the duplicate's arrival time.

    * ``after_s``: time in s from the request to the duplicate.
    * ``late_s``: additional delay in s of files sent after the duplicate's arrival.
    """
    copied_s: list[float] = []
    there, back = bench.robot.network[0].to_board, bench.robot.network[0].from_board

    def send(data: bytes, at_s: float, real: Any = there.send) -> None:
        real(data, at_s)
        if data == request and not copied_s:
            copied_s.append(at_s + after_s)
            real(data, at_s + after_s)

    def reply(data: bytes, at_s: float, real: Any = back.send) -> None:
        of_copy = copied_s and at_s >= copied_s[0] - TICK_S
        is_file = data.startswith(b"ok MCSpin") or len(data) > LONGEST_REPLY
        real(data, at_s + (late_s if of_copy and is_file else 0.0))

    there.send, back.send = send, reply
    return copied_s


def downloads(bench: MartBench) -> int:
    return bench.said().count(b"LAST TURN")


def test_the_angle_is_that_of_the_gyro_with_the_servers_sign() -> None:
    """The driver takes the angle from the line "stop detected" of the record.

    This angle includes the motion after the stop, in which the robot coasts.
    """
    assert recorded_deg([RECORD], MCR.request("SLOW", 90)) == -91.73
    assert recorded_deg([RECORD.replace(b"\n", b"\r\n")], MCR.request(90)) == -91.73


def test_the_file_of_another_angle_is_not_used() -> None:
    """The driver does not use the record of a turn for which another angle was requested.

    The record says that 90° were requested, but the driver has requested 89°.
    """
    assert recorded_deg([RECORD], MCL.request("SLOW", 89)) is None


def test_only_the_first_piece_of_the_file_is_needed() -> None:
    """The angle is in the first piece of a record. The loss of any other piece does no harm."""
    content = RECORD + b"10,,0.1,2\n" * 100
    first, *others = [content[at : at + PIECE] for at in range(0, len(content), PIECE)]
    assert recorded_deg([first, *others[1:]], MCR.request(90)) == -91.73
    assert recorded_deg(others, MCR.request(90)) is None
    assert recorded_deg([], MCR.request(90)) is None


@given(st.lists(st.binary(max_size=PIECE) | st.just(RECORD[:100]), max_size=4))
def test_any_other_file_has_no_angle(pieces: list[bytes]) -> None:
    """A file that is not the record of a turn, or whose beginning is incomplete, contains no angle.

    The driver finds no angle in such a file, and raises no error.
    """
    assert recorded_deg(pieces, MCR.request(90)) is None


@pytest.mark.slow
@pytest.mark.parametrize("inequality", [-0.05, 0.05])
def test_goals_are_reached_with_unequal_motors_that_are_not_calibrated(inequality: float) -> None:
    """The robot reaches all goals although one wheel is 5 % faster.

    The server reports no heading, so the driver downloads the server's record of each turn.
    """
    bench = MartBench("source", motor_inequality=inequality).ready()
    for goal in GOALS:
        go(bench, Pose(*goal))
        assert bench.truth.way_to(Pose(*goal)).way_m < 0.08
        assert abs(math.remainder(bench.truth.yaw_rad - goal[2], math.tau)) < math.radians(4)
    assert bench.error.way_m < 0.03
    assert downloads(bench) >= len(GOALS)


@pytest.mark.slow
@pytest.mark.parametrize("missing", ["angle", "file"])
def test_a_server_without_records_is_asked_three_times(
    missing: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The driver requests no more records after three requests without a usable record.

    The robot still reaches its goals.
    """
    bench = MartBench("source").ready()
    if missing == "angle":
        monkeypatch.setattr(files, "_turn_record", lambda motion: ("MC spin",))
    else:
        monkeypatch.setattr(bench.server, "save", lambda note: None)
    for goal in GOALS:
        go(bench, Pose(*goal))
        assert bench.truth.way_to(Pose(*goal)).way_m < 0.1
    assert downloads(bench) == UNRECORDED


@pytest.mark.slow
def test_records_are_read_only_until_they_have_shown_the_ratio_of_the_motors() -> None:
    """When a few records have shown the ratio of the motors, the driver requests no more records.

    The public server never closes a file that it has sent, so the driver avoids needless requests.
    """
    bench = MartBench("source", motor_inequality=0.1).ready()
    for _ in range(2):
        for goal in GOALS:
            go(bench, Pose(*goal))
    before = downloads(bench)
    assert 4 < before <= MOST
    for goal in GOALS[:2]:
        go(bench, Pose(*goal))
        assert bench.truth.way_to(Pose(*goal)).way_m < 0.15
    assert downloads(bench) == before


def test_the_record_of_an_earlier_turn_is_not_used() -> None:
    """Instead of a turn's record, the server sends that of an earlier turn with the same target.

    The driver does not use this record.
    """
    bench = MartBench("source").ready()
    for yaw_rad in (math.pi / 2, math.pi, -math.pi / 2, 0.0):
        go(bench, Pose(0.0, 0.0, yaw_rad))
    bench.server.save = lambda note: None
    count = downloads(bench)
    bench.go_to(0.0, 0.0, math.pi / 2)
    bench.run_until(lambda: not bench.robot.stands, 5.0)
    bench.server.motions[Kind.CONTROLLED_SPIN].target += 15
    bench.run_until(lambda: downloads(bench) > count, 20.0)
    bench.run(0.3)
    assert abs(bench.error.yaw_rad) < math.radians(3)


@pytest.mark.parametrize("lost", [b"LAST TURN", b"ok MCSpin"])
def test_a_lost_answer_of_the_record_hardly_delays_the_next_command(lost: bytes) -> None:
    """The driver requests the server's record of a turn. The request or its reply is lost.

    The next command still starts a motion at once.
    """
    bench = MartBench("source").ready()
    assert bench.job(Job.LOG).success
    lose_once(bench, lost)
    bench.go_to(0.0, 1.0, 0.0)
    bench.run_until(lambda: downloads(bench) == 1, 20.0)
    from_s = bench.now
    while not any(data.startswith(b"RM ") for data in bench.said()):
        bench.try_command(0.2, 0.0)
        bench.run(0.05)
    assert bench.now - from_s < 0.6
    assert not bench.board._pilot.jobs.log_may_be_lost


@pytest.mark.parametrize("late_s", [0.1, 0.2, 0.29])
def test_a_late_copy_of_the_driver_s_download_does_not_disturb_that_of_the_user(
    late_s: float,
) -> None:
    """The network duplicates the driver's request for the record of a turn.

    Then the user requests the record of a move. The driver first waits for late replies, so the
    user gets the right file.
    """
    bench = MartBench("source").ready()
    go(bench, Pose(0.5, 0.0, 0.0))
    copied_s = copy_late(bench, b"LAST TURN", 0.29, late_s)
    bench.go_to(0.5, 0.0, math.pi / 2)
    bench.run_until(lambda: bool(copied_s) and bench.board.resting, 30.0)
    done = bench.job(Job.LAST_MOVE)
    assert done.success
    assert done.name.startswith("TLinearMotion")


def test_a_new_command_does_not_wait_for_the_record() -> None:
    """While the record of a turn is on its way, the user stops the goal and drives.

    The robot drives at once.
    """
    bench = MartBench("source").ready()
    bench.go_to(0.0, 1.0, 0.0)
    bench.run_until(lambda: downloads(bench) == 1, 20.0)
    bench.session.command_twist(BodyTwist(0.0, 0.0, 0.0), bench.now)
    bench.command(0.2, 0.0, 1.0)
    assert any(data.startswith(b"RM ") for data in bench.said())
    assert bench.server.chassis.powered


def test_goals_that_are_replaced_early_do_not_end_the_use_of_records() -> None:
    """The user cancels each goal during the download of its record, so no record arrives.

    This does not show that the server has no records. The driver continues to request them.
    """
    bench = MartBench("source").ready()
    for count in range(1, UNRECORDED + 3):
        bench.go_to(0.0, (-1.0) ** count, 0.0)
        bench.run_until(lambda count=count: downloads(bench) == count, 30.0)
        bench.session.command_twist(BodyTwist(0.0, 0.0, 0.0), bench.now)
        bench.run(1.0)
    assert downloads(bench) > UNRECORDED


def test_a_reset_of_the_odometry_discards_the_record_of_the_turn_before() -> None:
    """A record of a turn before the last reset of the odometry does not change the heading."""
    bench = MartBench("source").ready()
    bench.go_to(0.0, 1.0, math.pi / 2)
    bench.run_until(lambda: downloads(bench) == 1, 20.0)
    odometry = bench.board._pilot.odometry
    odometry.reset()
    assert not odometry.turn_recorded(math.degrees(odometry.turn.spun_rad) + 2.0)
    assert odometry.pose == Pose()


def test_a_record_makes_the_heading_more_certain_but_not_better_than_the_gyro() -> None:
    """A record reduces the heading's variance, but not below that of a gyro angle.

    An impossible angle, or a second record of the same turn, has no effect.
    """
    bench = MartBench("source").ready()
    bench.go_to(0.0, 1.0, math.pi / 2)
    bench.run_until(lambda: downloads(bench) == 1, 20.0)
    odometry = bench.board._pilot.odometry
    before = odometry.doubt.total([]).yaw_yaw
    assert not odometry.turn_recorded(math.degrees(odometry.turn.spun_rad) + 60.0)
    assert odometry.turn_recorded(math.degrees(odometry.turn.spun_rad) + 2.0)
    assert math.radians(0.7) ** 2 < odometry.doubt.total([]).yaw_yaw < before / 4
    assert not odometry.turn_recorded(math.degrees(odometry.turn.spun_rad) + 2.0)
