# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of control frames: velocities, wheel speeds, stops and poses.

A board obeys poses only if its switch is on "position".
"""

from math import hypot

import pytest
from board_talk import ESTOP, RUNNING, STOP, WAKE_UP, run, velocity, wheels

from omnibot_driver.simulator.omnibot import (
    BoardPose,
    BoardSettings,
    ReceivedCommand,
    SimulatedBoard,
    TruePose,
)


@pytest.mark.parametrize(
    ("command", "twist"),
    [
        (velocity(35, 0, 0), (0.5, 0.0, 0.0)),
        (velocity(70, 0, 0), (1.0, 0.0, 0.0)),
        (velocity(0, -35, 0), (0.0, -0.5, 0.0)),
        (velocity(0, 0, 250), (0.0, 0.0, 0.5)),
        (velocity(14, 21, -100), (0.2, 0.3, -0.2)),
        (wheels(-14, -14, -14), (0.0, 0.0, 0.2 / 0.143)),
    ],
)
def test_a_commanded_velocity_is_reached(command: bytes, twist: tuple[float, float, float]) -> None:
    """The robot reaches the commanded velocity within 2 s.

    In a command, 70 LSB are 1 m/s, and 500 LSB are 1 rad/s.
    """
    board = SimulatedBoard(RUNNING)
    board.receive(command)
    run(board, 2.0)
    truth = board.truth
    assert (truth.vx_mps, truth.vy_mps, truth.yaw_rate) == pytest.approx(twist, abs=0.005)


def test_the_scales_of_the_settings_are_the_units_of_commands() -> None:
    """The settings can change the scales of commands, here to 100 LSB for 1 m/s."""
    board = SimulatedBoard(BoardSettings(running=True, linear_scale=100, angular_scale=1000))
    board.receive(velocity(20, 0, 200))
    run(board, 2.0)
    assert board.truth.vx_mps == pytest.approx(0.2, abs=0.005)
    assert board.truth.yaw_rate == pytest.approx(0.2, abs=0.005)


def test_a_wheel_command_drives_that_wheel_alone() -> None:
    """A command of one wheel's speed turns this wheel only.

    The words CMD_A, CMD_B and CMD_C of a frame set the rim speeds of the wheels A, B and C.
    """
    for wheel in range(3):
        board = SimulatedBoard(RUNNING)
        values = [0, 0, 0]
        values[wheel] = 28
        board.receive(wheels(*values))
        run(board, 2.0)
        assert board.rim_speeds_mps == pytest.approx([value / 70 for value in values], abs=0.003)


@pytest.mark.slow
def test_a_motion_goes_on_without_further_commands() -> None:
    """One command is sent, and then no more. After 60 s the robot still drives."""
    board = SimulatedBoard(RUNNING)
    board.receive(velocity(35, 0, 0))
    run(board, 60.0)
    assert board.truth.vx_mps == pytest.approx(0.5, abs=0.005)


def test_stop_stops() -> None:
    """The stop frame of the manual's appendix brings the robot to rest."""
    board = SimulatedBoard(RUNNING)
    board.receive(velocity(35, 0, 0))
    run(board, 1.0)
    board.receive(STOP)
    run(board, 1.0)
    assert board.truth.vx_mps == 0.0


@pytest.mark.parametrize("latches", [False, True])
def test_an_emergency_stop_stops_at_once(latches: bool) -> None:
    """An emergency stop switches the motors off in the same tick.

    The robot is at rest within 0.3 s and stays at rest.
    """
    board = SimulatedBoard(BoardSettings(running=True, estop_latches=latches))
    board.receive(velocity(35, 0, 0))
    run(board, 1.0)
    board.receive(ESTOP)
    assert board.estopped
    run(board, 0.3)
    assert board.rim_speeds_mps == (0.0, 0.0, 0.0)
    at_rest = board.truth
    run(board, 5.0)
    assert board.truth == at_rest


def test_an_emergency_stop_that_does_not_latch_ends_with_the_next_motion() -> None:
    """The emergency stop of this board does not latch. The next motion command moves the robot."""
    board = SimulatedBoard(RUNNING)
    board.receive(ESTOP + velocity(35, 0, 0))
    assert not board.estopped
    run(board, 2.0)
    assert board.truth.vx_mps == pytest.approx(0.5, abs=0.005)


def test_a_latching_emergency_stop_ends_with_a_reset_alone() -> None:
    """The emergency stop latches. Only a reset ends it, not a command, pause or start.

    The simulated board does not record the motion commands that it refuses.
    """
    board = SimulatedBoard(BoardSettings(running=True, estop_latches=True))
    board.receive(ESTOP + velocity(35, 0, 0) + b"PS" + velocity(35, 0, 0))
    run(board, 2.0)
    assert board.estopped
    assert board.truth == TruePose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert [command.kind for command in board.commands] == ["estop", "pause", "start"]
    board.receive(b"R")
    run(board, 1.0)
    board.receive(WAKE_UP + b"S" + velocity(35, 0, 0))
    run(board, 2.0)
    assert not board.estopped
    assert board.truth.vx_mps == pytest.approx(0.5, abs=0.005)


POSITION = BoardSettings(running=True, control="position")


@pytest.mark.slow
@pytest.mark.parametrize("goal", [(1000, 500, 1571), (-300, 0, -7000), (0, 0, 0), (2, -1, 1)])
def test_with_the_switch_on_position_the_robot_drives_to_the_commanded_pose(
    goal: tuple[int, int, int],
) -> None:
    """With the switch on "position", a command is a pose in the earth frame, in mm and mrad.

    If the heading is more than a full turn, the robot turns by the whole angle.
    """
    board = SimulatedBoard(POSITION)
    board.receive(velocity(*goal))
    run(board, 15.0)
    there = board.odometry
    assert (there.x_mm, there.y_mm, there.theta_mrad) == pytest.approx(goal, abs=2.0)
    at_rest = board.truth
    run(board, 2.0)
    assert board.truth == at_rest
    assert board.commands[-1] == ReceivedCommand(0, "pose", goal)


def test_on_the_way_to_a_pose_the_robot_keeps_to_a_walk() -> None:
    """The robot drives to a pose far away, at no more than 0.3 m/s."""
    board = SimulatedBoard(POSITION)
    board.receive(velocity(5000, 5000, 0))
    run(board, 5.0)
    assert hypot(board.truth.vx_mps, board.truth.vy_mps) == pytest.approx(0.3, abs=0.01)


def test_zeros_in_mode_one_are_a_drive_to_the_origin_and_stop_is_a_stop() -> None:
    """With the switch on "position", zeros in a frame of mode 1 command a drive to the origin.

    The stop frame has mode 2, and stops the robot.
    """
    board = SimulatedBoard(
        BoardSettings(running=True, control="position", initial_pose=BoardPose(1000.0))
    )
    board.receive(velocity(0, 0, 0))
    run(board, 1.0)
    assert board.truth.vx_mps < -0.2
    board.receive(STOP)
    run(board, 1.0)
    assert board.truth.vx_mps == 0.0
    assert board.odometry.x_mm > 500.0


@pytest.mark.parametrize("ending", [ESTOP, b"P", b"PS"])
def test_an_emergency_stop_or_a_pause_forgets_the_pose_to_drive_to(ending: bytes) -> None:
    """An emergency stop or a pause comes on the way to a pose.

    The robot does not continue afterwards.
    """
    board = SimulatedBoard(POSITION)
    board.receive(velocity(1000, 0, 0))
    run(board, 1.0)
    board.receive(ending)
    run(board, 1.0)
    at_rest = board.truth
    run(board, 1.0)
    assert board.truth == at_rest


def test_a_pause_stops_the_motors_and_forgets_the_command() -> None:
    """The board is paused during a drive, and starts again.

    The robot is at rest until the next command.
    """
    board = SimulatedBoard(RUNNING)
    board.receive(velocity(35, 0, 0))
    run(board, 1.0)
    board.receive(b"P")
    run(board, 0.3)
    at_rest = board.truth
    assert at_rest.vx_mps == 0.0
    board.receive(b"P")
    run(board, 2.0)
    assert board.truth == at_rest
