# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of odometry from the displacements of a synthetic board and of the simulated one."""

import math
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import axis_signs, headings, small_moves
from synthetic_board import (
    PERIOD_S,
    SETTINGS,
    Trip,
    attach,
    body,
    close,
    earth,
    heading,
    last,
    xyyaw,
)

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.odometry.estimate import OdometryEstimate
from omnibot_driver.core.odometry.estimator import Odometry
from omnibot_driver.core.omnibot import OmniBot, OmniBotSettings
from omnibot_driver.core.readings import DisplacementReading, PoseReading
from omnibot_driver.simulator.omnibot import BoardPose, BoardSettings, SimulatedBoard

# Driven paths


def test_straight_ahead_is_x() -> None:
    """The robot drives straight ahead at 0.5 m/s for 1 s. Odom ends at x = 0.5 m."""
    odometry = Odometry(SETTINGS)
    for _ in range(25):
        estimates = odometry.displace(body(0.02, 0.0), 0.0)
    assert last(estimates) == close((0.5, 0.0, 0.0))


@pytest.mark.parametrize("frame", ["earth", "body"])
def test_a_quarter_circle_to_the_left_ends_at_its_radius(frame: str) -> None:
    """The robot drives a quarter circle with a radius of 1 m in 50 steps. Odom is exact."""
    odometry, trip = Odometry(SETTINGS), Trip()
    attach(odometry, trip.pose)
    step = math.pi / 2 / 50
    for _ in range(50):
        estimates = odometry.displace(trip.move(step, 0.0, step, frame), 0.0)
    assert last(estimates) == close((1.0, 1.0, math.pi / 2))


def test_a_spin_stays_in_place_and_counts_its_turns() -> None:
    """The robot spins for several turns. The yaw is not wrapped."""
    odometry = Odometry(SETTINGS)
    for _ in range(100):
        estimates = odometry.displace(body(0.0, 0.0, 0.2), 0.0)
    assert last(estimates) == close((0.0, 0.0, 20.0))


@pytest.mark.slow
@given(st.lists(small_moves, min_size=1, max_size=40), headings, axis_signs)
@settings(max_examples=60)
def test_the_way_is_the_true_one_whatever_the_boards_heading_and_axes(
    moves: list[Pose], initial: float, signs: tuple[int, int, int]
) -> None:
    """The board has any initial heading and any axis signs.

    The published odometry equals the robot's true motion.
    """
    odometry, trip = Odometry(SETTINGS, signs), Trip(initial, signs)
    attach(odometry, trip.pose)
    for number, move in enumerate(moves):
        estimates = odometry.displace(trip.move(*xyyaw(move)), 0.0)
        if number % 5 == 4:
            odometry.settle(trip.pose)
    assert last(estimates) == close(trip.truth, 1e-8)


@given(st.lists(small_moves, min_size=1, max_size=40), axis_signs)
def test_body_deltas_need_no_pose(moves: list[Pose], signs: tuple[int, int, int]) -> None:
    """The board sends deltas in the body's axes. They are added up without a pose of the board.

    Each delta is published at once.
    """
    odometry, trip = Odometry(SETTINGS, signs), Trip(1.0, signs)
    for move in moves:
        estimates = odometry.displace(trip.move(*xyyaw(move), "body"), 0.0)
        assert len(estimates) == 1
    assert last(estimates) == close(trip.truth, 1e-8)
    assert not odometry.heading_assumed


@given(small_moves, headings, st.sampled_from(["earth", "body"]))
def test_the_twist_is_the_bodys_over_40_ms(move: Pose, initial: float, frame: str) -> None:
    """The robot moves with a constant twist. The odometry estimates exactly this twist.

    The estimate is the displacement divided by its duration, 40 ms, in the body's axes.
    """
    odometry, trip = Odometry(SETTINGS), Trip(initial)
    attach(odometry, trip.pose)
    for _ in range(3):
        (estimate,) = odometry.displace(trip.move(*xyyaw(move), frame), 0.0)
        twist = estimate.twist
        assert (twist.vx_mps, twist.vy_mps, twist.yaw_rate_radps) == close(
            (move.x_m / 0.04, move.y_m / 0.04, move.yaw_rad / 0.04), 1e-7
        )


def test_every_delta_gives_one_estimate_with_its_own_stamp() -> None:
    """Each delta gives one estimate with the delta's stamp, in order."""
    odometry = Odometry(SETTINGS)
    assert odometry.displace(earth(0.01, 0.0), 1.0) == []
    assert odometry.displace(earth(0.01, 0.0), 1.04) == []
    stamps = [estimate.stamp_s for estimate in attach(odometry, heading(0.0))]
    stamps += [estimate.stamp_s for estimate in odometry.displace(earth(0.01, 0.0), 1.08)]
    assert stamps == [1.0, 1.04, 1.08]


# Against the simulated board


def drive(board: SimulatedBoard, seed: int) -> tuple[list[OdometryEstimate], Odometry]:
    """Drive the board in curves for 12 s, then stop. Return all estimates and the odometry."""
    settings_ = board.settings
    bot = OmniBot(OmniBotSettings(delta_frame=settings_.frame))
    odometry, estimates, random = Odometry(SETTINGS), [], Random(seed)
    phases = [random.uniform(0, math.tau) for _ in range(3)]
    for tick in range(1400):
        if tick % 5 == 0:
            t, drives = tick / 100, tick < 1200
            command = [
                drives * size * math.sin(t * speed + phase)
                for size, speed, phase in zip((30, 30, 240), (0.9, 1.3, 0.5), phases, strict=True)
            ]
            words = [round(value) & 0xFFFF for value in command]
            data = bytes.fromhex("FF FE 01") + b"".join(word.to_bytes(2, "big") for word in words)
            board.receive(data)
        for reading in bot.receive(board.step(), tick / 100):
            if isinstance(reading, DisplacementReading):
                estimates += odometry.displace(reading, tick / 100)
            elif isinstance(reading, PoseReading):
                estimates += odometry.settle(reading)
    return estimates, odometry


@pytest.mark.slow
@pytest.mark.parametrize("frame", ["earth", "body"])
@pytest.mark.parametrize(
    ("initial", "seed"),
    [(BoardPose(), 1), (BoardPose(1000.0, -500.0, 2000.0), 2), (BoardPose(0.0, 9e3, -7000.0), 1)],
)
def test_the_odometry_is_the_truth_of_the_simulated_robot(
    frame: str, initial: BoardPose, seed: int
) -> None:
    """The robot drives more than 2 m in curves, from any initial pose of the board.

    Odom ends within 5 mm and 3 mrad of the truth.
    """
    board = SimulatedBoard(
        BoardSettings(seed=seed, frame=frame, initial_pose=initial, running=True)
    )
    estimates, odometry = drive(board, seed)
    truth = board.truth
    way = sum(math.hypot(e.twist.vx_mps, e.twist.vy_mps) * PERIOD_S for e in estimates)
    assert len(estimates) == 350
    assert way > 2.0
    assert not odometry.heading_assumed
    pose = estimates[-1].pose
    assert math.hypot(pose.x_m - truth.x_m, pose.y_m - truth.y_m) < 0.005
    assert pose.yaw_rad == pytest.approx(truth.yaw_rad, abs=0.003)


@pytest.mark.parametrize("frame", ["earth", "body"])
def test_the_twist_is_the_velocity_of_the_simulated_robot(frame: str) -> None:
    """The robot drives forward, drives left and turns at the same time. The twist is right."""
    board = SimulatedBoard(
        BoardSettings(frame=frame, initial_pose=BoardPose(0.0, 0.0, 1571.0), running=True)
    )
    bot, odometry = OmniBot(OmniBotSettings(delta_frame=board.settings.frame)), Odometry(SETTINGS)
    board.receive(bytes.fromhex("FF FE 01 00 15 00 0E 00 C8"))  # 0.3 m/s, 0.2 m/s, 0.4 rad/s
    twists = []
    for tick in range(600):
        for reading in bot.receive(board.step(), tick / 100):
            if isinstance(reading, DisplacementReading):
                twists += [e.twist for e in odometry.displace(reading, 0.0)]
            elif isinstance(reading, PoseReading):
                twists += [e.twist for e in odometry.settle(reading)]
    settled = twists[-100:]
    mean = [
        sum(getattr(twist, name) for twist in settled) / 100
        for name in ("vx_mps", "vy_mps", "yaw_rate_radps")
    ]
    assert mean == pytest.approx([0.3, 0.2, 0.4], abs=0.003)
