# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the sum of the delays of all samples, each from sampling to reading.

The sum contains neither the board's texts, which are not samples, nor the time of a pause.
"""

import pytest
from session_bench import TICK_S, Bench

from omnibot_driver.core.requests import Request


def test_a_board_that_was_paused_at_first_leaves_the_delay_a_number() -> None:
    """The «Paused» text of a board adds nothing to the sum of the delays.

    The text has no sampling time, so its delay is unknown. The sum stays a finite number.
    """
    bench = Bench()
    bench.open()
    bench.run_until_state("paused")
    bench.run_until_state("nominal")
    bench.run(5.0)
    tally = bench.session.figures(bench.now).tally
    assert 0.0 <= tally.delay_s < tally.reads * TICK_S
    assert 0.0 <= tally.squared_delay_s2 < tally.reads * TICK_S**2


def test_a_pause_is_not_a_delay() -> None:
    """The board is paused for 20 s. This time is not added to the sum of the delays."""
    bench = Bench()
    bench.open()
    bench.run_until_state("nominal")
    bench.run(2.0)
    before = bench.session.figures(bench.now).tally
    assert bench.ask(Request.PAUSE, 5.0).success
    bench.run(20.0)
    after = bench.session.figures(bench.now).tally
    assert after.delay_s - before.delay_s == pytest.approx(0.0, abs=0.1)
