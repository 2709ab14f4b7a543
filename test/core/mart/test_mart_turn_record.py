# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The angle of a controlled turn comes from the server's record, if the server has one."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mart_bench import MartBench

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.mart.jobs import PIECE
from omnibot_driver.core.mart.moves import UNRECORDED
from omnibot_driver.core.mart.turn_record import recorded_deg
from omnibot_driver.core.mart.words import MCL, MCR
from omnibot_driver.simulator.mart import files

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
"""The beginning of a file of the public server, for a turn to the right."""
GOALS = [(1.0, 1.0, 3.0), (-1.0, 0.5, -2.0), (0.5, -1.0, 1.5), (0.0, 0.0, 0.0)]


def go(bench: MartBench, goal: Pose) -> None:
    """Command the goal and wait until the driver has ended it."""
    bench.go_to(goal.x_m, goal.y_m, goal.yaw_rad)
    bench.run_until(lambda: bench.board.figures.own["Goal"].startswith("over"), 120.0)


def downloads(bench: MartBench) -> int:
    return bench.said().count(b"LAST TURN")


def test_the_angle_is_that_of_the_gyro_with_the_servers_sign() -> None:
    """The driver uses the angle at "stop detected".

    This angle includes the coasting of the robot.
    """
    assert recorded_deg([RECORD], MCR.request("SLOW", 90)) == -91.73
    assert recorded_deg([RECORD.replace(b"\n", b"\r\n")], MCR.request(90)) == -91.73


def test_the_record_of_another_turn_is_not_used() -> None:
    """The driver uses a record only if its target is the angle that the driver has requested."""
    assert recorded_deg([RECORD], MCL.request("SLOW", 89)) is None


def test_only_the_first_piece_of_the_file_is_needed() -> None:
    """The angle is in the first piece of the file. The loss of any other piece does no harm."""
    content = RECORD + b"10,,0.1,2\n" * 100
    first, *others = [content[at : at + PIECE] for at in range(0, len(content), PIECE)]
    assert recorded_deg([first, *others[1:]], MCR.request(90)) == -91.73
    assert recorded_deg(others, MCR.request(90)) is None
    assert recorded_deg([], MCR.request(90)) is None


@given(st.lists(st.binary(max_size=PIECE) | st.just(RECORD[:100]), max_size=4))
def test_any_other_file_has_no_angle(pieces: list[bytes]) -> None:
    """Other files, and records whose beginning is incomplete, contain no angle.

    They do not raise an error.
    """
    assert recorded_deg(pieces, MCR.request(90)) is None


@pytest.mark.parametrize("inequality", [-0.05, 0.05])
def test_goals_are_reached_with_unequal_motors_that_are_not_calibrated(inequality: float) -> None:
    """The server reports no heading in these moves, and one wheel turns 5 % faster.

    Without the records, each turn would be measured by the right wheel alone. The robot would miss
    the last goal by 0.2 m.
    """
    bench = MartBench("source", motor_inequality=inequality).ready()
    for goal in GOALS:
        go(bench, Pose(*goal))
        assert bench.truth.way_to(Pose(*goal)).way_m < 0.08
        assert abs(math.remainder(bench.truth.yaw_rad - goal[2], math.tau)) < math.radians(4)
    assert bench.error.way_m < 0.03
    assert downloads(bench) >= len(GOALS)


@pytest.mark.parametrize("missing", ["angle", "file"])
def test_a_server_without_records_is_asked_twice(
    missing: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The manual does not say what the file contains, so a server may give no angle.

    The robot reaches its goals without it. The driver requests the record of two turns, and then no
    more.
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
    """The user cancels the goal during each download. This says nothing about the server."""
    bench = MartBench("source").ready()
    for count in range(1, UNRECORDED + 3):
        bench.go_to(0.0, (-1.0) ** count, 0.0)
        bench.run_until(lambda count=count: downloads(bench) == count, 30.0)
        bench.session.command_twist(BodyTwist(0.0, 0.0, 0.0), bench.now)
        bench.run(1.0)
    assert downloads(bench) > UNRECORDED


def test_a_reset_of_the_odometry_discards_the_record_of_the_turn_before() -> None:
    """The odometry is reset, and the record of a turn from before arrives.

    The driver discards the record, because the new frame begins at the present heading.
    """
    bench = MartBench("source").ready()
    bench.go_to(0.0, 1.0, math.pi / 2)
    bench.run_until(lambda: downloads(bench) == 1, 20.0)
    odometry = bench.board._pilot.odometry
    odometry.reset()
    assert not odometry.turn_recorded(math.degrees(odometry.turn.spun_rad) + 2.0)
    assert odometry.pose == Pose()


def test_a_record_makes_the_heading_more_certain_but_not_better_than_the_gyro() -> None:
    """A record reduces the variance of the heading to that of an angle from the gyro.

    A record with an impossible angle, or a second record of the same turn, has no effect.
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
