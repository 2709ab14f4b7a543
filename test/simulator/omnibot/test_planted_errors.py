# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of errors that the simulated robot can have, such as a reversed axis.

The tests of calibrations use these errors.
"""

import struct
from math import pi, radians

import pytest

from omnibot_driver.simulator.omnibot import BoardSettings, SimulatedBoard
from omnibot_driver.simulator.omnibot.motors import (
    Motor,
    MotorConstants,
    WheelController,
    WheelGains,
)

IMU, DELTA, POSE = b"\xff\xfa", b"\xff\xfb", b"\xff\xfc"
FORWARD = bytes.fromhex("FF FE 01 00 08 00 00 00 00")
LEFT = bytes.fromhex("FF FE 01 00 00 00 08 00 00")
TURN = bytes.fromhex("FF FE 01 00 00 00 00 00 64")
WHEEL_B = bytes.fromhex("FF FE 02 00 00 00 08 00 00")


def driven(command: bytes, seconds: float = 1.0, **settings: object) -> SimulatedBoard:
    """Return a running board, ``seconds`` after it has received ``command``."""
    board = SimulatedBoard(BoardSettings(running=True, **settings))  # type: ignore[arg-type]
    board.receive(command)
    for _ in range(round(seconds * 100)):
        board.step()
    return board


def last(board: SimulatedBoard, header: bytes, count: int) -> tuple[int, ...]:
    """Return the first ``count`` values of the last frame with this header."""
    frame = next(sent.data for sent in reversed(board.sent) if sent.data.startswith(header))
    return struct.unpack_from(f">{count}h", frame, 2)


@pytest.mark.parametrize(
    ("command", "signs", "axis"),
    [(FORWARD, (-1, 1, 1), 0), (LEFT, (1, -1, 1), 1), (TURN, (1, 1, -1), 2)],
)
def test_a_reversed_axis_moves_the_robot_the_other_way_and_the_board_does_not_know(
    command: bytes, signs: tuple[int, int, int], axis: int
) -> None:
    """One axis of the board is reversed, so the robot moves opposite to the command.

    The board's own pose agrees with the command.
    """
    straight, reversed_ = driven(command), driven(command, axis_signs=signs)
    truth = (reversed_.truth.x_m, reversed_.truth.y_m, reversed_.truth.yaw_rad)
    assert truth[axis] < -0.05
    believed, expected = reversed_.odometry, straight.odometry
    assert believed.x_mm == pytest.approx(expected.x_mm, abs=2)
    assert believed.y_mm == pytest.approx(expected.y_mm, abs=2)
    assert believed.theta_mrad == pytest.approx(expected.theta_mrad, abs=15)


def test_wheel_counts_are_those_of_the_wheels() -> None:
    """Deltas in wheel counts contain the counts of the single wheels.

    Only wheel B turns. A delta has 39 counts for B, and 0 for A and C.
    """
    a, b, c = last(driven(WHEEL_B, 2.0, frame="wheel_counts"), DELTA, 3)
    assert (a, c) == (0, 0)
    assert b == pytest.approx(8 / 70 * 0.04 * 1560 / (2 * pi * 0.029), abs=1.5)


def test_each_motor_has_its_own_constants() -> None:
    """One motor has a longer time constant, so it is slower at first. The others are unchanged."""
    slow = MotorConstants(time_constant_ticks=30.0)
    board = driven(FORWARD, 0.15, motors=(slow, MotorConstants(), MotorConstants()))
    a, b, _ = board.rim_speeds_mps
    assert abs(a) < 0.6 * abs(b)


def test_a_motors_delay_holds_its_effort_back() -> None:
    """Two motors get the same effort, and one of them has a delay of three ticks.

    The motor with the delay moves like the other one, but three ticks later.
    """
    prompt, late = Motor(), Motor(MotorConstants(delay_ticks=3))
    turned = [prompt.advance(500.0) for _ in range(10)]
    assert [late.advance(500.0) for _ in range(10)] == [0.0, 0.0, 0.0, *turned[:7]]


def test_the_controllers_gains_are_those_given() -> None:
    """After a jump of the commanded speed by 10, the effort is 10 times the sum of the gains."""
    gains = WheelGains(feed_forward=5.0, proportional=2.0, integral=1.0)
    assert WheelController(gains).update(10.0, 0.0) == 80.0


@pytest.mark.parametrize(
    ("mounted", "held", "expected"),
    [
        ((pi, 0.0, 0.0), {"pitch_rad": radians(-30)}, (0.5, 0.0, -0.866)),
        ((pi, 0.0, 0.0), {"roll_rad": radians(30)}, (0.0, -0.5, -0.866)),
        ((0.0, 0.0, 0.0), {"roll_rad": radians(30)}, (0.0, 0.5, 0.866)),
        ((0.0, 0.0, pi / 2), {"pitch_rad": radians(-30)}, (0.0, -0.5, 0.866)),
    ],
)
def test_a_robot_that_is_held_feels_gravity_by_its_mounting(
    mounted: tuple[float, float, float],
    held: dict[str, float],
    expected: tuple[float, float, float],
) -> None:
    """The IMU of a tilted robot measures gravity in the axes of the IMU's mounting.

    REP-103: a raised front is a negative pitch, a raised left side is a positive roll.
    """
    board = driven(b"", 0.1, imu_rpy_rad=mounted, accel_noise_g=0.0)
    board.hold(**held)
    board.step()
    assert [word / 16384 for word in last(board, IMU, 6)[:3]] == pytest.approx(expected, abs=1e-3)


def test_a_robot_that_is_turned_by_hand_feels_it_and_its_wheels_do_not() -> None:
    """If a robot is turned left by hand, the upside-down gyro reads a negative rate.

    The wheels do not turn.
    """
    board = driven(b"", 0.1, gyro_noise_dps=0.0, gyro_bias_dps=(0.0, 0.0, 0.0))
    board.hold(yaw_rate=radians(30))
    board.step()
    assert last(board, IMU, 6)[5] == pytest.approx(-30 * 131, abs=1)
    assert board.truth.yaw_rad == 0.0
