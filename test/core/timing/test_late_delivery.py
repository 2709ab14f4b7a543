# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of data that a network delivers late and complete, while the driver is awake."""

from itertools import pairwise

import pytest
from session_bench import TICK_S, Bench

from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.simulator.omnibot import BoardSettings

READ = 4096
"""Largest number of bytes in one read."""


@pytest.mark.parametrize("stall_s", [1.7, 2.6, 4.0])
def test_data_that_a_network_delivers_late_have_the_stamps_of_their_sampling(
    stall_s: float,
) -> None:
    """The robot drives. The network delivers nothing for seconds, and then everything at once.

    The stamps are as even as without the delay, and no motion seems to be uncommanded.
    """
    bench = Bench(BoardSettings(seed=3, running=True))
    bench.open()
    bench.run(2.0)
    for _ in range(10):
        bench.drive(0.3, yaw_rate=0.3)
        bench.run(0.1)
    held = b""
    for _ in range(round(stall_s / TICK_S)):
        bench.now += TICK_S
        held += bench.board.step()
        if bench.now >= bench.session.wake_at:
            bench.session.tick(bench.now)
        bench.settle()
    assert bench.session.state == "connecting"
    for place in range(0, len(held), READ):
        bench.session.inbound.receive(held[place : place + READ], bench.now)
        bench.settle()
    bench.run(1.0)
    imu_s = [event.stamp_s for event in bench.events if isinstance(event, ImuEstimate)]
    for period_s, stamps_s in (
        (0.04, [estimate.stamp_s for estimate in bench.odometry]),
        (TICK_S, imu_s),
    ):
        late_s = bench.now - stamps_s[-1]
        steps_s = [after - before for before, after in pairwise(stamps_s)]
        assert late_s < 2 * period_s
        assert steps_s == pytest.approx([period_s] * len(steps_s), abs=0.002)
    assert not any("without a command" in notice for notice in bench.notices)
