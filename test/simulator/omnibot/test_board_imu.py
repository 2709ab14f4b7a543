# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the simulated MPU6050: gravity, motion, bias, noise and range."""

import struct
from math import degrees

import pytest
from board_talk import (
    IMU,
    RUNNING,
    run,
    sent,
    velocity,
    wheels,
)

from omnibot_driver.simulator.omnibot import (
    BoardSettings,
    SimulatedBoard,
)


def readings(board: SimulatedBoard, seconds: float) -> list[tuple[float, ...]]:
    """Return the IMU readings of the next ``seconds``, in g and °/s."""
    board.sent.clear()
    run(board, seconds)
    raw = [struct.unpack(">6h", frame[2:]) for frame in sent(board, IMU)]
    return [(*(a / 16384 for a in one[:3]), *(w / 131 for w in one[3:])) for one in raw]


def mean(values: list[tuple[float, ...]]) -> tuple[float, ...]:
    return tuple(sum(column) / len(values) for column in zip(*values, strict=True))


def rms(values: list[tuple[float, ...]]) -> tuple[float, ...]:
    means = mean(values)
    return tuple(
        (sum((value - middle) ** 2 for value in column) / len(values)) ** 0.5
        for column, middle in zip(zip(*values, strict=True), means, strict=True)
    )


def test_at_rest_the_upside_down_sensor_feels_minus_one_g() -> None:
    """The robot is at rest. The sensor, mounted upside down, measures gravity on -z.

    Its bias and noise are those of the settings.
    """
    board = SimulatedBoard(BoardSettings(running=True, gyro_bias_dps=(1.0, -2.0, 3.0)))
    values = readings(board, 20.0)
    assert mean(values) == pytest.approx((0.0, 0.0, -1.0, 1.0, -2.0, 3.0), abs=0.005)
    assert rms(values)[:3] == pytest.approx([0.0028] * 3, rel=0.1)
    assert rms(values)[3:] == pytest.approx([0.05] * 3, rel=0.1)


def test_the_gyro_at_rest_reads_like_frame_headers_by_default() -> None:
    """By default the gyro at rest reads -6, -5 and -4, whose bytes look like frame headers."""
    values = mean(readings(SimulatedBoard(RUNNING), 20.0))
    assert [rate * 131 for rate in values[3:]] == pytest.approx([-6, -5, -4], abs=0.5)


def test_turning_left_is_negative_on_the_upside_down_gyro() -> None:
    """The robot turns left at 0.5 rad/s. The gyro, mounted upside down, reads -0.5 on z."""
    board = SimulatedBoard(BoardSettings(running=True, gyro_bias_dps=(0.0, 0.0, 0.0)))
    board.receive(velocity(0, 0, 250))
    run(board, 2.0)
    *_, rate_z = mean(readings(board, 2.0))
    assert rate_z == pytest.approx(-degrees(0.5), rel=0.01)


def test_driving_off_to_the_left_is_felt_on_minus_y() -> None:
    """The upside-down sensor measures an acceleration to the left as negative y."""
    board = SimulatedBoard(BoardSettings(running=True, accel_noise_g=0.0))
    board.receive(velocity(14, 28, 0))
    values = readings(board, 1.0)
    gained_mps = [sum(column) * 9.80665 * 0.01 for column in zip(*values, strict=True)]
    assert gained_mps[:2] == pytest.approx((0.2, -0.4), abs=0.005)


@pytest.mark.parametrize(
    ("x", "y", "felt_mps2"), [(35, 0, (0.0, -0.5)), (0, 35, (-0.5, 0.0))], ids=["ahead", "left"]
)
def test_a_curve_is_felt_as_centripetal_acceleration(
    x: int, y: int, felt_mps2: tuple[float, float]
) -> None:
    """In a left curve, the IMU measures 0.5 m/s² to the left of the motion.

    The sensor is mounted upside down, so y is reversed.
    """
    board = SimulatedBoard(RUNNING)
    board.receive(velocity(x, y, 500))
    run(board, 2.0)
    values = mean(readings(board, 5.0))
    assert values[:2] == pytest.approx([felt / 9.80665 for felt in felt_mps2], abs=0.002)


def test_readings_saturate_at_the_range_of_the_sensor() -> None:
    """The robot turns faster than 250 °/s. The gyro reads the largest 16-bit value."""
    board = SimulatedBoard(RUNNING)
    board.receive(wheels(60, 60, 60))
    run(board, 1.0)
    assert readings(board, 0.1)[0][5] == 32767 / 131


@pytest.mark.slow
def test_a_bias_that_walks_gets_as_far_as_it_should_in_a_second() -> None:
    """The gyro's bias changes at random.

    After a second, the RMS of the bias over sixty robots is the value in the settings.
    """
    ends = []
    for seed in range(60):
        board = SimulatedBoard(
            BoardSettings(
                running=True,
                seed=seed,
                gyro_walk_dps=2.0,
                gyro_noise_dps=0.0,
                gyro_bias_dps=(0.0, 0.0, 0.0),
            )
        )
        ends.append(readings(board, 1.0)[-1][3:])
    assert rms(ends) == pytest.approx([2.0] * 3, rel=0.3)


def test_a_stuck_gyro_reads_its_counts_whatever_the_motion() -> None:
    """A gyro is stuck: it always reads the same counts.

    It reads them even in a turn, while the accelerometer varies.
    """
    board = SimulatedBoard(BoardSettings(running=True, gyro_stuck=(-6, -5, -4)))
    board.receive(velocity(0, 0, 250))
    run(board, 1.0)
    frames = sent(board, IMU)
    assert {frame[8:] for frame in frames} == {bytes.fromhex("FF FA FF FB FF FC")}
    assert len({frame[:8] for frame in frames}) > 50
