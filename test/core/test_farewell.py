# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The last bytes before the port is closed: the robot is stopped, and left as it was asked for."""

import pytest
from bench import EMERGENCY_STOP, PAUSE, RESET, STOP, Bench
from robots import paused, standing

from omnibot_driver.core.supervisor import Request
from omnibot_driver.simulator import BoardMode


@pytest.fixture
def bench() -> Bench:
    return standing()


@pytest.mark.parametrize(
    ("on_exit", "expected"), [("stop", b""), ("pause", STOP + PAUSE), ("reset", STOP + RESET)]
)
def test_the_farewell_stops_the_robot_whatever_else_it_does(
    bench: Bench, on_exit: str, expected: bytes
) -> None:
    """Stop comes first."""
    assert bench.session.farewell(on_exit) == 3 * STOP + expected


def test_a_farewell_to_a_paused_board_does_not_unpause_it() -> None:
    """P is a toggle."""
    bench = paused()
    assert bench.session.farewell("pause") == 3 * STOP


def test_a_farewell_while_a_pause_is_in_flight_still_ends_paused(bench: Bench) -> None:
    """P has been said and not yet shown: a second one alone would undo it."""
    bench.session.request(Request.PAUSE, object(), bench.now)
    bench.settle()
    bench.speaks = False
    while b"P" not in bench.written_since(0):
        bench.speaks = True
        bench.run(0.01)
        bench.speaks = False
    bench.board.receive(bench.session.farewell("pause"))
    bench.hears = False
    bench.run(1.0)
    assert bench.board.mode is BoardMode.PAUSED


def test_a_farewell_while_a_start_is_in_flight_ends_paused() -> None:
    """The notice is still believed, but S is on its way."""
    bench = paused()
    bench.session.request(Request.START, object(), bench.now)
    bench.settle()
    bench.board.receive(bench.session.farewell("pause"))
    bench.hears = False
    bench.run(1.0)
    assert bench.board.mode is BoardMode.PAUSED


def test_a_farewell_under_estop_repeats_the_estop(bench: Bench) -> None:
    """The last thing the board hears is that it must not move."""
    bench.session.estop(True, bench.now)
    assert bench.session.farewell("stop") == 3 * STOP + EMERGENCY_STOP
