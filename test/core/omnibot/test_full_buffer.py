# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of reads that are so late that the kernel's buffer is full, and later bytes are lost."""

import math

import pytest
from lossy_odometry import DELTA
from session_bench import TICK_S, Bench

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.simulator.omnibot import BoardSettings

READ = 4095
"""Largest number of bytes that a read of a terminal returns."""


def board_pose(bench: Bench) -> Pose:
    pose = bench.board.odometry
    return Pose(pose.x_mm / 1000.0, pose.y_mm / 1000.0, pose.theta_mrad / 1000.0)


def last_count(bench: Bench) -> int:
    """Return the counter of the last delta that the board sent."""
    return next(sent.data[-1] for sent in reversed(bench.board.sent) if sent.data[:2] == DELTA)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stall_s", "kept", "yaw_rates", "count", "turns"),
    [
        (*stall, count, turns)
        for *stall, large in [
            (6.0, READ, (0.0, 0.5), (254, 0)),
            (11.0, READ, (0.5, 0.0), (60, 1)),
            (10.0, 3 * READ, (0.5, 0.0), (200, 0)),
            (15.0, 3 * READ, (0.0, 0.5), (60, 1)),
        ]
        for count, turns in [(0, 1), (3, 0), large]
    ],
)
def test_motion_that_the_full_buffer_lost_is_in_odom_whatever_the_counter_shows(
    stall_s: float, kept: int, yaw_rates: tuple[float, float], count: int, turns: int
) -> None:
    """Motion that is lost because the kernel's buffer is full is in odom a second later.

    The counter of the next delta may be small, as after a restart of the board.
    """
    bench = Bench(BoardSettings(seed=3, running=True))
    bench.open()
    bench.run(2.0)
    origin = board_pose(bench)
    while (last_count(bench) + round(stall_s / 0.04) - count) % 256:
        if bench.board.tick % 10 == 0:
            bench.drive(0.4, yaw_rate=yaw_rates[turns])
        bench.run(TICK_S)
    held = b""
    for _ in range(round(stall_s / TICK_S)):
        held += bench.board.step()
        bench.now += TICK_S
    driven = board_pose(bench)
    for place in range(0, kept, READ):
        bench.session.inbound.receive(held[place : place + READ], bench.now)
        bench.now += 0.001
    bench.settle()
    bench.run(1.0)
    assert origin.way_to(driven).way_m > 0.1
    off = bench.odometry[-1].pose - origin.way_to(board_pose(bench))
    assert off.way_m < 0.005
    assert abs(math.remainder(off.yaw_rad, math.tau)) < 0.005
    assert not any("moves faster" in notice for notice in bench.notices)
