# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the last bytes before the port is closed: Stop, then perhaps a pause or a reset."""

import pytest
from robots import driving, paused, standing
from session_bench import EMERGENCY_STOP, PAUSE, RESET, STOP, TICK_S, Bench

from omnibot_driver.core.requests import OnExit, Request
from omnibot_driver.simulator.omnibot import BoardMode


@pytest.fixture
def bench() -> Bench:
    return standing()


@pytest.mark.parametrize(
    ("on_exit", "expected"), [("stop", b""), ("pause", STOP + PAUSE), ("reset", STOP + RESET)]
)
def test_the_shutdown_sequence_stops_the_robot_whatever_else_it_does(
    bench: Bench, on_exit: OnExit, expected: bytes
) -> None:
    """At shutdown, the driver first writes Stop three times, then what ``on_exit`` demands.

    For a pause, this is Stop and the letter P; for a reset, Stop and the letter R.
    """
    assert bench.last_words(on_exit) == 3 * STOP + expected


def test_a_shutdown_of_a_paused_board_does_not_unpause_it() -> None:
    """The board is paused at shutdown. The driver sends no P, which would resume the board."""
    bench = paused()
    assert bench.last_words("pause") == 3 * STOP


def test_a_shutdown_while_a_pause_is_in_flight_still_ends_paused(bench: Bench) -> None:
    """A shutdown during an unconfirmed pause sends no second P, which would resume the board."""
    bench.session.request(Request.PAUSE, object(), bench.now)
    bench.settle()
    bench.speaks = False
    while b"P" not in bench.written_since(0):
        bench.speaks = True
        bench.run(0.01)
        bench.speaks = False
    bench.board.receive(bench.last_words("pause"))
    bench.hears = False
    bench.run(1.0)
    assert bench.board.mode is BoardMode.PAUSED


def test_a_shutdown_while_a_start_is_in_flight_ends_paused() -> None:
    """A paused board receives S (start). Directly after that, the driver shuts down.

    The setting ``on_exit`` is pause. The shutdown pauses the board again.
    """
    bench = paused()
    bench.session.request(Request.START, object(), bench.now)
    bench.settle()
    bench.board.receive(bench.last_words("pause"))
    bench.hears = False
    bench.run(1.0)
    assert bench.board.mode is BoardMode.PAUSED


def test_a_shutdown_under_estop_repeats_the_estop(bench: Bench) -> None:
    """The e-stop is latched at shutdown.

    The last frame that the driver writes is ES, the board's own emergency stop.
    """
    bench.session.estop(True, bench.now)
    assert bench.last_words("stop") == 3 * STOP + EMERGENCY_STOP


def left(bench: Bench) -> None:
    """Begin the shutdown and wait until the robot is seen at rest, as ``Link.close`` does."""
    bench.session.shutdown.begin(bench.now)
    bench.settle()
    while not bench.session.shutdown.stands:
        bench.run(TICK_S)


def test_a_robot_that_was_driven_is_looked_at_in_silence_before_the_driver_ends() -> None:
    """At shutdown, the driver sends nothing for a moment, and checks that the robot stays at rest.

    The driver is silent because a bad line could turn any frame into a motion.
    """
    bench = driving()
    left(bench)
    assert bench.session.shutdown.fall_silent(bench.now)
    start = len(bench.written)
    assert not bench.session.shutdown.stands
    bench.run(0.2)
    assert bench.session.shutdown.stands
    assert bench.written_since(start) == b""
    assert bench.last_words("stop") == b""


def test_a_last_stop_that_the_line_made_a_motion_is_not_the_last() -> None:
    """At shutdown, a fault of the line turns the last Stop into a motion.

    The driver sees that the robot moves, and sends Stop again.
    """
    bench = driving()
    left(bench)
    bench.board.receive(bytes(8) + bytes.fromhex("FF FE 02 00 20 00 20 00 20"))
    assert bench.session.shutdown.fall_silent(bench.now)
    bench.run(0.2)
    assert not bench.session.shutdown.stands
    assert bench.last_words("stop") == 3 * STOP


def test_what_a_paused_board_cannot_show_is_not_waited_for() -> None:
    """At shutdown, the driver does not wait for a proof that a paused robot is at rest.

    A paused board sends no displacements, but its motors are off.
    """
    bench = paused()
    left(bench)
    assert not bench.session.shutdown.fall_silent(bench.now)
    assert bench.session.shutdown.stands
