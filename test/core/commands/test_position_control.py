# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of goals (cmd_pose), sent to a simulated board whose switch is set to position control."""

import math
from collections.abc import Callable

import pytest
from robots import push, reconnect
from session_bench import EMERGENCY_STOP, STOP, Bench, bare

from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.odometry.estimate import OdometrySettings
from omnibot_driver.core.requests import Request
from omnibot_driver.simulator.omnibot import BoardPose, BoardSettings

ORIGIN = BoardPose()


def at_position_control(
    initial_pose: BoardPose = ORIGIN, *, imu_only: bool = False, **options: object
) -> Bench:
    """Return a bench with a running board whose switch is set to position control."""
    settings = BoardSettings(
        running=True, control="position", initial_pose=initial_pose, imu_only=imu_only
    )
    bench = Bench(settings, **options)  # type: ignore[arg-type]
    bench.open()
    bench.run_until_state("imu_only" if imu_only else "nominal")
    bench.run(1.5)
    return bench


@pytest.fixture
def bench() -> Bench:
    return at_position_control()


def where(bench: Bench) -> tuple[float, float, float]:
    pose = bench.odometry[-1].pose
    return pose.x_m, pose.y_m, pose.yaw_rad


def words(bench: Bench) -> list[int]:
    data = bare(bench.written[-1][1])
    assert data[:3] == b"\xff\xfe\x01"
    return [int.from_bytes(data[n : n + 2], "big", signed=True) for n in (3, 5, 7)]


def test_a_goal_is_on_the_wire_at_once_in_the_boards_frame_and_is_repeated(bench: Bench) -> None:
    """The driver sends a goal at once, and repeats it because the board does not acknowledge it."""
    start = len(bench.written)
    bench.go_to(1.0, -0.5, 1.571)
    assert bare(bench.written_since(start)) == bytes.fromhex("FF FE 01 03 E8 FE 0C 06 23")
    bench.run(10.0)
    assert len(bench.written) - start == pytest.approx(200, abs=2)
    assert {data for _, data in bench.written[start:]} == {bench.written[start][1]}
    assert where(bench) == pytest.approx((1.0, -0.5, 1.571), abs=0.005)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("heading", "signs"),
    [
        (0.0, (1, 1, 1)),
        (1571.0, (1, -1, -1)),
        (-4000.0, (-1, 1, -1)),
        (-4000.0, (1, 1, 1)),
        (16000.0, (-1, -1, 1)),
        (16000.0, (1, -1, -1)),
    ],
)
def test_a_goal_in_odom_is_reached_wherever_the_board_believed_to_be(
    heading: float, signs: tuple[int, int, int]
) -> None:
    """The robot reaches its goals, whatever the board's first pose and its axes' signs are."""
    bench = at_position_control(BoardPose(5000.0, -3000.0, heading), axis_signs=signs)
    bench.go_to(0.8, 0.4, 0.9)
    bench.run(6.0)
    assert where(bench) == pytest.approx((0.8, 0.4, 0.9), abs=0.005)
    bench.go_to(0.0, 0.0, -0.5)
    bench.run(6.0)
    assert where(bench) == pytest.approx((0.0, 0.0, -0.5), abs=0.005)


@pytest.mark.parametrize("turns", [-2, 0, 3])
def test_the_robot_takes_the_shorter_turn_however_often_it_has_turned_before(turns: int) -> None:
    """The robot turns to a goal by less than half a turn, also after several full turns.

    The board's heading counts full turns.
    """
    at = 1000 * math.tau * turns + 3000.0
    bench = at_position_control(BoardPose(0.0, 0.0, at))
    bench.go_to(0.0, 0.0, 0.4)
    assert words(bench)[2] == pytest.approx(at + 400, abs=1)
    bench.run(0.02)
    bench.go_to(0.0, 0.0, -3.0)
    assert words(bench)[2] == pytest.approx(at - 3000, abs=1)
    bench.run(0.02)
    bench.go_to(0.0, 0.0, 3.4)
    assert words(bench)[2] == pytest.approx(at - 1000 * (math.tau - 3.4), abs=1)


def test_a_goal_beyond_the_words_is_refused_and_the_old_one_stays(bench: Bench) -> None:
    """The driver rejects a goal that does not fit into 16-bit words, and keeps the old goal."""
    bench.go_to(0.2, 0.0, 0.0)
    for x in (33.0, 1e300, -1.7e308):
        with pytest.raises(CommandRefused, match="the limits are"):
            bench.go_to(x, 0.0, 0.0)
    bench.run(0.2)
    assert words(bench) == [200, 0, 0]


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_goal_that_is_not_finite_is_refused(bench: Bench, bad: float) -> None:
    """A goal with infinity or NaN in x, in y or in yaw is rejected."""
    for goal in ((bad, 0.0, 0.0), (0.0, bad, 0.0), (0.0, 0.0, bad)):
        with pytest.raises(CommandRefused, match="NaN or infinity"):
            bench.go_to(*goal)


def test_velocities_are_refused_while_the_switch_stands_on_position(bench: Bench) -> None:
    """The driver refuses velocities while it is set to position control.

    The board would interpret a velocity of 0.3 m/s as a goal 21 mm from the origin.
    """
    start = len(bench.written)
    for command in (lambda: bench.drive(0.3), lambda: bench.turn_wheels(1.0, 1.0, 1.0)):
        with pytest.raises(CommandRefused, match="`control_method` is 'position'"):
            command()
    assert bench.written_since(start) == b""


def test_goals_are_refused_while_the_switch_stands_on_velocity() -> None:
    """The driver is set to velocity control and refuses goals.

    The board would interpret a goal 1 m from the origin as a velocity of 14 m/s.
    """
    bench = Bench(BoardSettings(running=True))
    bench.open()
    bench.run(1.5)
    start = len(bench.written)
    with pytest.raises(CommandRefused, match="`control_method` is 'velocity'"):
        bench.go_to(1.0, 0.0, 0.0)
    assert bench.written_since(start) == b""


@pytest.mark.parametrize("options", [{"imu_only": True}, {"use_board_pose": False}])
def test_goals_are_refused_where_the_boards_pose_is_not_known(options: dict[str, bool]) -> None:
    """The driver refuses goals while the board's pose is unknown or unused.

    A goal in odom must be converted to the board's frame.
    """
    bench = at_position_control(**options)  # type: ignore[arg-type]
    with pytest.raises(CommandRefused, match="not known"):
        bench.go_to(1.0, 0.0, 0.0)


def test_a_goal_is_right_also_after_a_gap_and_before_the_next_pose(bench: Bench) -> None:
    """Displacements are lost, and a goal arrives before the board's next pose.

    The driver still converts the goal correctly.
    """
    bench.go_to(1.0, 0.0, 0.0)
    bench.run(0.5)
    bench.speaks = False
    bench.run(0.2)
    bench.speaks = True
    bench.run(0.06)
    bench.go_to(0.5, 0.3, 0.2)
    assert words(bench) == [500, 300, 200]


def estop(bench: Bench) -> None:
    bench.session.estop(True, bench.now)
    bench.settle()
    assert bench.written[-1][1] == 2 * (EMERGENCY_STOP + STOP)
    bench.session.estop(False, bench.now)
    bench.settle()


@pytest.mark.slow
@pytest.mark.parametrize(
    "event",
    [
        estop,
        reconnect,
        lambda bench: bench.session.reset_odometry(bench.now),
        lambda bench: bench.board.reboot(),
        lambda bench: bench.ask(Request.RESET, 10.0),
        lambda bench: (bench.ask(Request.PAUSE, 5.0), bench.ask(Request.START, 5.0)),
    ],
    ids=["estop", "reconnect", "reset_odometry", "restart", "reset", "pause"],
)
def test_whatever_discards_a_command_discards_a_goal(
    bench: Bench, event: Callable[[Bench], object]
) -> None:
    """An event such as a reset or an e-stop discards the goal, and the robot stops.

    The robot does not drive to this goal later. It rests until a new goal arrives.
    """
    bench.go_to(3.0, 0.0, 0.5)
    bench.run(1.0)
    event(bench)
    bench.settle()
    bench.run(3.0)
    assert bench.session.state == "nominal"
    assert bench.still()
    x, y, yaw_rad = where(bench)
    assert x < 1.0
    bench.run(2.0)
    assert where(bench)[0] == pytest.approx(x, abs=1e-3)
    bench.go_to(x + 0.2, y + 0.1, yaw_rad - 0.3)
    bench.run(4.0)
    assert where(bench) == pytest.approx((x + 0.2, y + 0.1, yaw_rad - 0.3), abs=0.01)


def test_the_user_is_told_that_a_short_silence_has_ended_a_goal(bench: Bench) -> None:
    """A silence of 0.35 s during a drive discards the goal, and a notice says so.

    A goal is sent only once, so its sender would wait in vain.
    """
    bench.go_to(3.0, 0.0, 0.0)
    bench.run(1.0)
    bench.speaks = False
    bench.run(0.35)
    bench.speaks = True
    bench.run(3.0)
    assert bench.board.truth.x_m < 2.5
    (said,) = (notice for notice in bench.notices if "goal" in notice)
    assert "the goal of cmd_pose is discarded: no data from the board for 0.3 s" in said


def test_standing_still_on_the_way_to_a_goal_is_the_manuals_stop_frame(bench: Bench) -> None:
    """A reset of the odometry during a drive to a goal discards the goal, and Stop is sent.

    A velocity frame with zeros would be a goal at the origin.
    """
    bench.go_to(3.0, 0.0, 0.0)
    bench.run(1.0)
    start = len(bench.written)
    bench.session.reset_odometry(bench.now)
    bench.settle()
    bench.run(0.5)
    assert {data for _, data in bench.written[start:]} == {STOP}
    assert [text for text in bench.notices if "goal" in text]


@pytest.mark.slow
@pytest.mark.parametrize("scale", ["linear_scale", "angular_scale"])
def test_a_new_scale_of_odom_discards_a_goal(bench: Bench, scale: str) -> None:
    """A new scale of odom discards the current goal, with a notice; the next goal is accepted."""
    bench.go_to(3.0, 0.0, 0.5)
    bench.run(0.2)
    bench.configure(odometry=bench.settings.odometry)
    assert bench.notices == []
    bench.configure(odometry=OdometrySettings(**{scale: 1.5}))
    bench.run(8.0)
    assert bench.board.truth.x_m < 0.5
    (said,) = bench.notices
    assert "the goal of cmd_pose is discarded" in said
    assert "scale" in said
    assert bench.session.figures(bench.now).commands.trips == 0
    bench.go_to(1.0, 0.0, 0.0)
    bench.run(4.0)
    assert where(bench) == pytest.approx((1.0, 0.0, 0.0), abs=0.05)


@pytest.mark.parametrize("goal", [(1.0, 0.0, 0.0), (0.3, -0.3, 0.0), (0.0, 0.0, 1.0)])
def test_a_robot_that_drives_away_from_its_goal_is_stopped(
    goal: tuple[float, float, float],
) -> None:
    """A robot that drives away from its goal is stopped, and a notice names the board's switch.

    If the switch is set to velocity control, the board takes a goal for a velocity.
    """
    bench = Bench(BoardSettings(running=True), control="position")
    bench.open()
    bench.run(1.5)
    bench.go_to(*goal)
    bench.run(4.0)
    assert bench.still()
    assert len([text for text in bench.notices if "switch" in text]) == 1


def test_a_robot_that_is_pushed_a_little_keeps_its_goal(bench: Bench) -> None:
    """A robot at its goal is pushed by hand. The board moves it back. No notice appears."""
    bench.go_to(0.3, 0.0, 0.0)
    bench.run(3.0)
    pushed = bench.board.odometry
    for _ in range(20):
        push(bench, -0.01, 0.0, 0.015)
        bench.run(0.04)
    bench.run(3.0)
    assert bench.board.odometry.x_mm == pytest.approx(pushed.x_mm, abs=2.0)
    assert bench.notices == []
