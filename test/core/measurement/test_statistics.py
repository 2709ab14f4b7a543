# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the counts of lost readings, with a simulated OmniBot."""

import pytest
from session_bench import TICK_S, Bench

from omnibot_driver.simulator.omnibot import BoardSettings


def lost(bench: Bench) -> tuple[int, int]:
    """Return how many IMU readings and how many displacements were lost."""
    tally = bench.session.figures(bench.now).tally
    return tally.lost_imu, tally.lost_displacements


@pytest.mark.parametrize("silence_s", [0.04, 0.2, 1.0, 5.0])
def test_a_silent_line_has_lost_imu_readings_with_the_displacements(silence_s: float) -> None:
    """The line is silent, and IMU frames have no counter.

    The driver counts four lost IMU readings for each lost delta.
    """
    bench = Bench(BoardSettings(running=True))
    bench.open()
    bench.run(2.0)
    assert lost(bench) == (0, 0)
    bench.speaks = False
    bench.run(silence_s)
    bench.speaks = True
    bench.run(2.0)
    assert lost(bench) == (round(silence_s / 0.01), round(silence_s / 0.04))


def test_a_pause_loses_nothing() -> None:
    """The board is paused and does not measure. No readings count as lost."""
    bench = Bench(BoardSettings(running=True))
    bench.open()
    bench.run(2.0)
    bench.board.receive(b"P")
    bench.run(3.3)
    bench.run_until_state("nominal")
    bench.run(2.0)
    assert lost(bench) == (0, 0)


@pytest.mark.parametrize("restarts", [False, True])
def test_a_restart_after_a_pause_counts_only_if_lost_deltas_do_not_explain_it(
    restarts: bool,
) -> None:
    """The board restarts, or is only paused and started. The first delta afterwards is lost.

    The driver counts a restart only if the board has restarted.
    """
    bench = Bench(BoardSettings(running=True))
    bench.open()
    bench.run(3.0)
    if restarts:
        bench.board.reboot()
    else:
        bench.board.receive(b"P")
    bench.run_until_state("paused")
    displacements = bench.session.figures(bench.now).tally.displacements
    while b"\xff\xfb" not in bench.board.step():
        bench.now += TICK_S
        bench.session.tick(bench.now)
        bench.settle()
    bench.run(2.0)
    tally = bench.session.figures(bench.now).tally
    assert tally.displacements > displacements
    assert tally.restarts == restarts


def test_a_restart_that_a_delta_and_a_pose_show_counts_once() -> None:
    """The board restarts. First the count of a delta shows it, then that of a pose."""
    bench = Bench(BoardSettings(running=True))
    bench.open()
    bench.run(8.0)
    bench.speaks = False
    bench.board.receive(b"R")
    bench.run(0.9)
    bench.board.receive(bytes(3) + b"S")
    bench.run(0.2)
    bench.speaks = True
    bench.run(2.0)
    assert bench.session.state == "nominal"
    assert bench.session.figures(bench.now).tally.restarts == 1
