# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of an adapter that holds data back for seconds, overflows, and then recovers."""

import math
from itertools import pairwise

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from session_bench import TICK_S, Bench

from omnibot_driver.core.odometry.estimate import OdometryEstimate, OdometrySettings
from omnibot_driver.simulator.omnibot import BoardSettings

HELD = 4095
"""Size of the adapter's buffer in bytes, for 2.4 s of data.

While the buffer is full, all further bytes are lost.
"""


def through_a_stall(ticks: int, frame: str, vx: float, yaw_rate: float) -> Bench:
    """Let a robot drive, and an adapter hold back all data for ``ticks`` ticks; return the bench.

    The adapter then delivers the data in its buffer, and the bench runs for two more seconds.
    """
    bench = Bench(BoardSettings(frame=frame))
    bench.open()
    bench.run_until_state("nominal")
    for _ in range(10):
        bench.drive(vx, 0.1, yaw_rate)
        bench.run(10 * TICK_S)
    held, bench.hears = b"", False
    for _ in range(ticks):
        bench.now += TICK_S
        held += bench.board.step()
        if bench.now >= bench.session.wake_at:
            bench.session.tick(bench.now)
        bench.settle()
    bench.hears = True
    bench.session.inbound.receive(held[:HELD], bench.now)
    bench.settle()
    bench.run(2.0)
    return bench


def step(before: OdometryEstimate, after: OdometryEstimate) -> float:
    return math.hypot(after.pose.x_m - before.pose.x_m, after.pose.y_m - before.pose.y_m)


@pytest.mark.slow
@settings(max_examples=12)
@given(st.integers(20, 700), st.sampled_from(["earth", "body"]), st.floats(-0.4, 0.4))
@example(ticks=400, frame="earth", vx=0.4)
@example(ticks=592, frame="earth", vx=0.0)
@example(ticks=291, frame="body", vx=0.4)
def test_no_step_is_larger_than_its_stamps_allow(ticks: int, frame: str, vx: float) -> None:
    """An adapter holds back data and loses some of it, but odom never shows an impossible speed.

    Two seconds after the adapter has delivered the data, odom is right.
    """
    bench = through_a_stall(ticks, frame, vx, 0.5)
    fastest_mps = OdometrySettings().fastest_mps
    for before, after in pairwise(bench.odometry):
        seconds = max(after.stamp_s - before.stamp_s, 0.04)
        assert step(before, after) <= fastest_mps * seconds + 0.005
    last, told = bench.odometry[-1].pose, bench.board.odometry
    assert math.hypot(last.x_m - told.x_mm / 1000, last.y_m - told.y_mm / 1000) < 0.002
    assert abs(math.remainder(last.yaw_rad - told.theta_mrad / 1000, math.tau)) < 0.002
