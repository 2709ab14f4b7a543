# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the e-stop: sent at once, repeated without end, and ended only by a release."""

from unittest.mock import ANY

import pytest
from robots import drive_on, driving, estop
from session_bench import EMERGENCY_STOP, OPENING, START, STOP, Bench

from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.events import StateChanged
from omnibot_driver.core.requests import Request

LATCHED_AND_RELEASED = ["e-stop latched by the driver", "e-stop released by the driver"]


@pytest.fixture
def bench() -> Bench:
    return driving()


def test_the_estop_is_out_at_once_and_refuses_commands(bench: Bench) -> None:
    """An e-stop during a drive is sent at once, and stops the robot.

    Until its release, commands are refused, and only pairs of ES and Stop are sent.
    """
    bench.drive(0.5)
    bench.run(0.1)
    start = len(bench.written)
    assert "latched" in bench.session.estop(True, bench.now)
    bench.settle()
    assert bench.written_since(start) == 2 * (EMERGENCY_STOP + STOP)
    with pytest.raises(CommandRefused, match="~/estop"):
        bench.drive(0.5)
    start += 1
    bench.run(5.0)
    assert {data for _, data in bench.written[start:]} == {EMERGENCY_STOP + STOP}
    assert bench.still()
    assert StateChanged("nominal", True) in bench.events


def test_the_estop_survives_reconnect_restart_start_and_reset(bench: Bench) -> None:
    """A reconnect, a restart of the board, ~/start and ~/reset do not end a latched e-stop.

    After its release, the robot waits for a new command.
    """
    bench.session.estop(True, bench.now)
    bench.settle()
    bench.close()
    bench.open()
    bench.run(1.0)
    bench.board.reboot()
    bench.run(3.0)
    bench.ask(Request.START, 5.0)
    bench.ask(Request.RESET, 10.0)
    assert bench.session.estop_active
    bench.run(1.0)
    assert bench.written[-1][1] == EMERGENCY_STOP + STOP
    assert "released" in bench.session.estop(False, bench.now)
    bench.settle()
    bench.run(2.0)
    assert bench.still()
    bench.drive(0.3)
    bench.run(0.3)
    assert not bench.still()


def test_an_estop_is_the_first_frame_that_a_reconnected_board_hears_after_the_opening(
    bench: Bench,
) -> None:
    """The user latches the e-stop while the port is closed.

    After the opening of the port, the driver sends Stop and S (start), and directly after them the
    emergency stop.
    """
    bench.close()
    assert "port is not open" in estop(bench, True)
    start = len(bench.written)
    bench.open()
    assert bench.written_since(start) == OPENING + START + 2 * (EMERGENCY_STOP + STOP)
    bench.run(2.0)
    assert bench.still()


def test_only_a_release_ends_an_estop_and_a_command_from_before_it_is_worth_nothing(
    bench: Bench,
) -> None:
    """While the e-stop is latched, commands are refused. Its release does not move the robot.

    The robot moves only after a new command.
    """
    estop(bench, True)
    for _ in range(100):
        with pytest.raises(CommandRefused, match="e-stop"):
            bench.drive(0.4)
        bench.run(0.01)
    estop(bench, False)
    bench.run(1.0)
    assert bench.still()
    drive_on(bench)
    assert not bench.still()


def test_a_board_that_holds_the_estop_itself_is_told_of_with_the_way_out() -> None:
    """The user has released the e-stop, but the board keeps its own emergency stop latched.

    Such a board ignores all commands until it is reset. One notice advises a call of ~/reset.
    """
    bench = driving(estop_latches=True)
    estop(bench, True)
    bench.run(1.0)
    estop(bench, False)
    for _ in range(8):
        drive_on(bench)
    assert bench.still()
    told = [*LATCHED_AND_RELEASED, ANY]
    assert bench.notices == told
    assert "~/reset" in bench.notices[-1]
    assert bench.ask(Request.RESET, 10.0).success
    drive_on(bench)
    assert not bench.still()
    assert bench.notices == told


def test_a_board_that_does_not_hold_the_estop_gives_no_notice(bench: Bench) -> None:
    """A user latches and releases the e-stop three times, and drives on after each release.

    The board does not keep an emergency stop latched, so no notice advises ~/reset.
    """
    for _ in range(3):
        estop(bench, True)
        bench.run(0.5)
        estop(bench, False)
        for _ in range(4):
            drive_on(bench)
    assert bench.notices == 3 * LATCHED_AND_RELEASED


def test_who_latched_the_estop_and_who_released_it_is_told_once(bench: Bench) -> None:
    """Two users latch the e-stop, and later two users release it.

    Only the first latch and the first release are reported.
    """
    for active, by in ((True, "a topic"), (True, "a service"), (False, "Ann"), (False, "Bob")):
        bench.session.estop(active, bench.now, by=by)
        bench.settle()
    assert bench.notices == ["e-stop latched by a topic", "e-stop released by Ann"]


def test_an_estop_that_nobody_may_have_heard_says_so(bench: Bench) -> None:
    """The answer to an e-stop warns if the board was silent for 2 s, or if the port is closed."""
    assert estop(bench, True) == "e-stop latched"
    bench.speaks = False
    bench.run(2.0)
    assert "unconfirmed" in estop(bench, True)
    bench.close()
    assert "not open" in estop(bench, True)
