# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A session stops robots that do not move as commanded, and the log says why."""

import pytest
from disobedient_robots import (
    SLOWLY,
    Triple,
    by_wheels,
    on_the_wrong_switch,
    started,
    stopped_after_s,
    try_to_drive,
)
from robots import driving
from session_bench import STOP, TICK_S, Bench

from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.simulator.omnibot import BoardPose, BoardSettings, SimulatedBoard

WITHIN_S = 0.3

FORWARD, TURN, TURN_SLOWLY = (0.5, 0.0, 0.0), (0.0, 0.0, 0.5), (0.0, 0.0, 0.15)

A_AND_B = {"motor_wiring": (2, 1, 3)}

A_REVERSED = {"motor_wiring": (-1, 2, 3)}

ALL_REVERSED = {"motor_wiring": (-1, -2, -3)}

FAST = {"linear_scale": 70 / 2.38}

FAST_TURNS = {"angular_scale": 500 / 2.38}

BY_HALF, TURNS_BY_HALF = {"linear_scale": 70 / 1.5}, {"angular_scale": 500 / 1.6}

DISOBEYING = {
    "too fast": (FAST, FORWARD, "moves faster", "`linear_scale`"),
    "too fast, slowly": (FAST, SLOWLY, "moves faster", "`linear_scale`"),
    "too fast, sideways": (FAST, (0.0, -0.2, 0.0), "moves faster", "`linear_scale`"),
    "turns too fast": (FAST_TURNS, TURN, "turns faster", "`angular_scale`"),
    "turns too fast, slowly": (FAST_TURNS, TURN_SLOWLY, "turns faster", "`angular_scale`"),
    "too fast by 0.05 m/s": (BY_HALF, (0.1, 0.0, 0.0), "moves faster", "`linear_scale`"),
    "turns too fast by 0.18 rad/s": (
        TURNS_BY_HALF,
        (0.0, 0.0, 0.3),
        "turns faster",
        "`angular_scale`",
    ),
    "motors A and B swapped": (A_AND_B, SLOWLY, "wrong direction", "wiring of the wheels"),
    "motor A reversed": (A_REVERSED, SLOWLY, "wrong direction", "wiring of the wheels"),
    "all reversed": (ALL_REVERSED, TURN_SLOWLY, "wrong direction", "wiring of the wheels"),
}


@pytest.mark.slow
@pytest.mark.parametrize("frame", ["earth", "body", "wheel_counts"])
@pytest.mark.parametrize(
    ("board", "command", "what", "advice"), DISOBEYING.values(), ids=DISOBEYING
)
def test_a_robot_that_does_not_do_what_it_is_commanded_is_stopped_within_0_3_s(
    board: dict[str, object], command: Triple, what: str, advice: str, frame: str
) -> None:
    """The board's scale or its wiring is wrong, so the robot does not move as commanded.

    The driver stops the robot. Its notice gives the fault and what to check.
    """
    bench = started(BoardSettings(running=True, frame=frame, **board))  # type: ignore[arg-type]
    assert stopped_after_s(bench, command) <= WITHIN_S
    (notice,) = bench.notices
    assert what in notice
    assert advice in notice


@pytest.mark.slow
@pytest.mark.parametrize(
    ("board", "command"),
    [(board, command) for board, command, _, _ in DISOBEYING.values()],
    ids=DISOBEYING,
)
def test_with_a_displacement_every_0_1_s_it_takes_no_longer(
    board: dict[str, object], command: Triple
) -> None:
    """With a displacement only every 0.1 s, the robot is still stopped within 0.3 s.

    So the monitor must find the fault in three displacements.
    """
    for phase in range(0, 10, 3):
        bench = started(BoardSettings(running=True, delta_period_s=0.1, **board))  # type: ignore[arg-type]
        bench.run(phase * TICK_S)
        assert stopped_after_s(bench, command) <= WITHIN_S


@pytest.mark.slow
@pytest.mark.parametrize("speed_mps", [0.05, 0.3])
@pytest.mark.parametrize("phase", range(0, 10, 3))
def test_a_robot_that_turns_round_within_a_long_displacement_was_not_held(
    phase: int, speed_mps: float
) -> None:
    """A robot that is commanded forward reverses within a displacement of 0.1 s.

    The driver sends Stop within 0.3 s, although this displacement may look like that of a held
    robot.
    """
    bench = started(BoardSettings(running=True, delta_period_s=0.1))
    for _ in range(10):
        bench.drive(speed_mps)
        bench.run(0.1)
    bench.run(phase * TICK_S)
    bench.board.grip(-speed_mps, 0.0, 0.0)
    mark, begun = len(bench.written), bench.now
    while bench.now < begun + 1.0 and not bench.written_since(mark).endswith(STOP):
        bench.drive(speed_mps)
        bench.run(TICK_S)
    assert bench.now - begun <= WITHIN_S


@pytest.mark.parametrize("frame", ["earth", "body"])
def test_a_switch_that_stands_on_position_is_noticed_within_0_3_s(frame: str) -> None:
    """A board's switch is on position control, so the board takes each velocity for a goal.

    The robot moves in the wrong direction. The driver stops the robot within 0.3 s and 5 cm.
    """
    bench = on_the_wrong_switch(frame)
    before = bench.board.truth.x_m
    assert stopped_after_s(bench, SLOWLY) <= WITHIN_S
    bench.run(2.0)
    assert bench.still()
    assert abs(bench.board.truth.x_m - before) < 0.05
    assert "wrong direction" in bench.notices[0]
    assert "`control_method`" in bench.notices[0]


@pytest.mark.parametrize("board", [FAST, A_AND_B])
def test_wheel_commands_are_watched_as_well(board: dict[str, object]) -> None:
    """The user commands wheel rates, and the robot does not obey them.

    The monitor compares the robot's motion with the twist that results from these rates.
    """
    bench = started(BoardSettings(running=True, **board))  # type: ignore[arg-type]
    assert stopped_after_s(bench, (0.3, 0.0, 0.0), by_wheels) <= WITHIN_S


def test_wheel_commands_that_are_obeyed_are_not_noticed() -> None:
    """The user commands each wheel alone, then all wheels.

    The robot obeys, and no fault is reported.
    """
    bench = started(BoardSettings(running=True))
    for rates in ((10.0, 0.0, 0.0), (0.0, -10.0, 0.0), (0.0, 0.0, 5.0), (17.0, 17.0, -17.0)):
        for _ in range(10):
            bench.turn_wheels(*rates)
            bench.run(0.1)
    assert bench.notices == []


def test_the_log_gives_the_robots_axes_where_the_boards_are_others() -> None:
    """The board's axes differ from the robot's. The log has velocities in the robot's axes."""
    bench = started(BoardSettings(running=True, **FAST), axis_signs=(-1, 1, -1))  # type: ignore[arg-type]
    stopped_after_s(bench, FORWARD)
    assert "commanded 0.50, 0.00 m/s" in bench.notices[0]
    assert "measured 1." in bench.notices[0]


@pytest.mark.parametrize(
    ("heading_mrad", "what"), [(1571.0, "wrong direction"), (700.0, "moves faster")]
)
def test_a_wrong_delta_frame_is_among_what_to_check(heading_mrad: float, what: str) -> None:
    """The robot obeys, but the driver reads its displacements in the wrong frame.

    The notice advises to check ``delta_frame``.
    """
    bench = Bench(BoardSettings(running=True, initial_pose=BoardPose(0.0, 0.0, heading_mrad)))
    bench.read_deltas_as("body")
    bench.open()
    bench.run(2.0)
    try_to_drive(bench, 2.0)
    (text,) = (text for text in bench.notices if what in text)
    assert "`delta_frame`" in text


def test_a_setting_that_the_boards_own_frames_contradict_is_what_to_check() -> None:
    """Deltas come less often than ``delta_period`` says, so every velocity is computed too large.

    The notice advises to correct this parameter.
    """
    bench = Bench(BoardSettings(running=True))
    bench.board = SimulatedBoard(BoardSettings(running=True, delta_period_s=0.1))
    bench.open()
    bench.run(2.0)
    try_to_drive(bench, 2.0)
    (text,) = (text for text in bench.notices if "robot stopped" in text)
    assert (
        "set the parameter `delta_period` to 0.1; if this does not help, check `control_method`"
        in text
    )


def test_what_board_and_driver_agree_on_is_not_noticed() -> None:
    """The axis signs are wrong both for commands and for displacements.

    Commanded and measured motion agree, so the monitor cannot notice the fault.
    """
    bench = started(BoardSettings(running=True, axis_signs=(-1, 1, 1)))
    for _ in range(10):
        bench.drive(0.3)
        bench.run(0.1)
    assert bench.notices == []
    assert bench.board.truth.x_m < -0.1


def test_a_goal_that_the_robot_drives_away_from_trips_as_well() -> None:
    """If the robot drives away from its goal, the motion monitor trips."""
    bench = started(BoardSettings(running=True, control="velocity"), control="position")
    bench.go_to(-0.5, 0.0, 0.0)
    bench.board.grip(0.4, 0.0, 0.0)
    bench.run(2.0)
    assert "moving away" in bench.notices[0]
    assert bench.session.figures(bench.now).commands.trips == 1


@pytest.mark.parametrize("jitter_m", [0.0, 0.005])
def test_a_node_that_repeats_such_a_goal_does_not_set_the_robot_in_motion_again(
    jitter_m: float,
) -> None:
    """A robot drives away from a goal, which a node repeats, exactly or nearly, ten times a second.

    The motion monitor trips, and the driver refuses further repetitions.
    """
    bench = started(BoardSettings(running=True, control="velocity"), control="position")
    bench.board.grip(0.4, 0.0, 0.0)
    for number in range(11):
        if not bench.notices:
            bench.go_to(-0.5, number % 2 * jitter_m, 0.0)
        bench.run(0.1)
    assert "moving away" in bench.notices[0]
    for _ in range(20):
        with pytest.raises(CommandRefused, match="the motion monitor has stopped the robot"):
            bench.go_to(-0.5, 0.0, 0.0)
        bench.run(0.1)
    assert bench.session.figures(bench.now).commands.trips == 1


def test_without_the_motion_monitor_such_a_goal_is_discarded_and_the_next_one_accepted() -> None:
    """The motion monitor is off, and the robot drives away from its goal.

    The driver discards the goal and stops the robot. It accepts the next goal.
    """
    bench = started(BoardSettings(running=True, control="velocity"), control="position")
    bench.configure(motion_monitor=False)
    bench.go_to(-0.5, 0.0, 0.0)
    bench.board.grip(0.4, 0.0, 0.0)
    mark = len(bench.written)
    bench.run(2.0)
    (notice,) = [text for text in bench.notices if "moving away" in text]
    assert "refused" not in notice
    assert STOP in bench.written_since(mark)
    assert bench.session.figures(bench.now).commands.trips == 0
    bench.go_to(0.5, 0.0, 0.0)


def test_the_motion_in_a_recording_discards_no_goal() -> None:
    """The driver plays a recording in which the robot drives away from the goal.

    A recorded robot cannot obey, so the driver neither discards the goal nor gives a notice.
    """
    bench = started(BoardSettings(running=True), control="position", obeys=False)
    bench.hears = False
    bench.go_to(-0.5, 0.0, 0.0)
    bench.board.grip(0.4, 0.0, 0.0)
    bench.run(2.0)
    assert bench.board.truth.x_m > 0.5
    assert bench.notices == []


def test_a_robot_that_is_faster_than_it_can_be_is_stopped() -> None:
    """The robot is too fast to be plausible, so all its displacements are rejected.

    The driver still stops it.
    """
    bench = driving()
    for _ in range(5):
        bench.drive(0.4)
        bench.run(0.1)
    bench.board.grip(2.5, 0.0, 0.0)
    mark, begun = len(bench.written), bench.now
    while bench.now < begun + 1.0 and not bench.written_since(mark).endswith(STOP):
        bench.drive(0.4)
        bench.run(TICK_S)
    assert bench.now - begun <= WITHIN_S
    assert [text for text in bench.notices if "`fastest_linear_speed`" in text]
    assert bench.session.figures(bench.now).commands.trips == 1
