# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Test of a board that another program pauses and starts again, before the driver's next read."""

import pytest
from session_bench import STOP, TICK_S, Bench

from omnibot_driver.simulator.omnibot import BoardSettings


@pytest.mark.slow
@pytest.mark.parametrize("run", [True, False])
@pytest.mark.parametrize("imu_only", [True, False])
@pytest.mark.parametrize("kept_back", [3, 12, 25])
def test_what_was_commanded_before_it_ends_with_stop(
    kept_back: int, imu_only: bool, run: bool
) -> None:
    """Another program pauses the board and starts it again.

    The board may then resume a command from before the pause. So the driver sends Stop for 1 s.
    """
    bench = Bench(BoardSettings(seed=2, running=True, imu_only=imu_only), run=run)
    bench.open()
    bench.run(2.0)
    for _ in range(10):
        bench.drive(0.3)
        bench.run(0.05)
    held = b""
    for tick in range(kept_back):
        if tick in (0, 1):
            bench.board.receive(b"P")
        held += bench.board.step()
        bench.now += TICK_S
        if bench.now >= bench.session.wake_at:
            bench.session.tick(bench.now)
        bench.settle()
    start = len(bench.written)
    bench.session.inbound.receive(held, bench.now)
    bench.settle()
    assert imu_only or STOP in bench.written_since(start)
    bench.run(0.9)
    assert len(bench.written) - start > 10
    assert bench.written[-1][1] == STOP
    assert bench.still()
