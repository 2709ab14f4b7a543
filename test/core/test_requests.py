# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of start and reset, and of rules for all requests: one at a time, each answered in time."""

import itertools

import pytest
from robots import drive_on, driving, paused, standing
from session_bench import OPENING, RESET, START, STOP, Bench

from omnibot_driver.core.errors import CommandRefused, RequestRefused
from omnibot_driver.core.events import StateChanged
from omnibot_driver.core.requests import Request, RequestDone
from omnibot_driver.simulator.omnibot import BoardMode, BoardSettings


@pytest.fixture
def bench() -> Bench:
    return standing()


@pytest.mark.parametrize(
    ("request_", "limit_s"), [(Request.START, 5.0), (Request.PAUSE, 5.0), (Request.RESET, 10.0)]
)
def test_on_a_silent_board_every_request_is_answered_in_time(
    request_: Request, limit_s: float
) -> None:
    """If the board is silent, each request fails within its time limit.

    The answer says what to check.
    """
    bench = Bench()
    bench.speaks = False
    bench.open()
    bench.run(2.0)
    answer = bench.ask(request_, limit_s)
    assert not answer.success
    assert "power" in answer.message


@pytest.mark.slow
def test_a_board_that_does_not_hear_gets_no_false_confirmation(bench: Bench) -> None:
    """The board sends data but receives none. A pause is reported as failed within 5 s.

    A reset is reported as failed within 10 s.
    """
    bench.hears = False
    answer = bench.ask(Request.PAUSE, 5.0)
    assert not answer.success
    assert "cable" in answer.message
    answer = bench.ask(Request.RESET, 10.0)
    assert not answer.success


def test_one_request_is_under_way_at_a_time(bench: Bench) -> None:
    """A second request is refused at once while the first is under way."""
    bench.session.request(Request.RESET, object(), bench.now)
    with pytest.raises(RequestRefused, match="a reset is under way"):
        bench.session.request(Request.PAUSE, object(), bench.now)


def test_a_request_that_the_drivers_end_cuts_short_says_so(bench: Bench) -> None:
    """A request that is under way at shutdown fails, and its answer says why."""
    bench.speaks = False
    bench.session.request(Request.RESET, object(), bench.now)
    bench.session.shutdown.begin(bench.now)
    bench.session.closed(bench.now)
    bench.settle()
    (done,) = [event for event in bench.events if isinstance(event, RequestDone)]
    assert (done.success, done.message) == (False, "the driver is shutting down; start it again")


def test_requests_without_a_port_are_refused() -> None:
    """While the port is closed, requests are refused immediately, not after a timeout."""
    with pytest.raises(RequestRefused, match="port is not open"):
        Bench().session.request(Request.START, object(), 0.0)


def test_a_request_ends_with_the_port(bench: Bench) -> None:
    """A request fails as soon as the port is lost, so the caller does not wait in vain."""
    bench.session.request(Request.RESET, token := object(), bench.now)
    bench.close()
    answers = [event for event in bench.events if isinstance(event, RequestDone)]
    assert [(answer.token, answer.success) for answer in answers] == [(token, False)]


def test_what_was_asked_of_a_lost_port_is_not_said_on_the_next() -> None:
    """The port is lost before the driver has written a requested reset. The reset is never written.

    When the port is open again, the driver writes Stop and S (start), but not R (reboot).
    """
    bench = standing()
    bench.session.request(Request.RESET, object(), bench.now)
    bench.session.closed(bench.now)
    start = len(bench.written)
    bench.open()
    assert bench.written_since(start) == OPENING + START


@pytest.mark.parametrize("speaks", [True, False])
def test_between_what_is_due_nobody_is_woken(speaks: bool) -> None:
    """During a request, ``wake_at`` is always later than now, so no thread wakes up without need.

    The test runs with a board that sends data, and with a silent one.
    """
    bench = Bench()
    bench.speaks = speaks
    bench.open()
    for request in (Request.START, Request.PAUSE, Request.RESET):
        bench.session.request(request, token := object(), bench.now)
        while not any(isinstance(e, RequestDone) and e.token is token for e in bench.events):
            bench.run(0.01)
            assert bench.session.wake_at > bench.now


def test_starting_a_running_board_is_confirmed_and_changes_nothing(bench: Bench) -> None:
    """A request to start a board that already runs succeeds, and the robot drives on.

    The driver still writes S, because a P of another program may be on its way.
    """
    bench.drive(0.3)
    start = len(bench.written)
    assert bench.ask(Request.START, 1.0).message == "running (nominal)"
    assert bench.written_since(start).startswith(START)
    bench.run(0.1)
    assert not bench.still()


def test_a_reset_brings_a_running_board_back_and_the_odometry_goes_on(bench: Bench) -> None:
    """The driver resets a running board with Stop and R.

    The board's own pose begins at zero again, but odom continues from its last pose.
    """
    for _ in range(20):
        bench.drive(0.5)
        bench.run(0.1)
    bench.run(1.0)
    before, start = bench.odometry[-1].pose, len(bench.written)
    answer = bench.ask(Request.RESET, 10.0)
    assert answer.success
    assert bench.written_since(start).startswith(STOP + RESET)
    assert bench.board.odometry.x_mm == pytest.approx(0.0, abs=0.5)
    bench.run(1.0)
    after = bench.odometry[-1].pose
    assert (after.x_m, after.y_m) == pytest.approx((before.x_m, before.y_m), abs=2e-3)
    assert bench.still()


@pytest.mark.parametrize("asked", [False, True])
def test_a_reset_of_a_paused_board_leaves_it_paused(asked: bool) -> None:
    """The board is paused and then reset. It is paused again afterwards.

    The answer to the request says that the board is paused.
    """
    bench = standing() if asked else paused()
    if asked:
        assert bench.ask(Request.PAUSE, 5.0).success
    bench.run(0.5)
    answer = bench.ask(Request.RESET, 10.0)
    assert answer.success
    assert "paused, as before the restart" in answer.message
    bench.run(3.0)
    assert bench.board.mode is BoardMode.PAUSED
    assert [command.kind for command in bench.board.commands].count("reset") == 1


@pytest.mark.slow
@pytest.mark.parametrize("runs", [True, False])
def test_a_board_that_boots_within_a_tenth_of_a_second_is_reset_once(runs: bool) -> None:
    """The user resets a board that boots within 0.1 s.

    The driver sends only one R, because n in the second text «Paused: n» shows the restart.
    """
    bench = Bench(BoardSettings(boot_time_s=0.05, running=runs), run=runs)
    bench.open()
    bench.run_until_state("nominal" if runs else "paused")
    bench.run(1.5)
    answer = bench.ask(Request.RESET, 10.0)
    assert answer.success
    assert [command.kind for command in bench.board.commands].count("reset") == 1
    bench.run(1.5)
    assert bench.session.state == ("nominal" if runs else "paused")


def test_a_paused_board_that_does_not_hear_r_is_not_said_to_have_restarted() -> None:
    """A reset fails if a paused board does not receive R.

    The numbers in the «Paused» texts continue, which shows that the board did not restart.
    """
    bench = Bench(run=False)
    bench.open()
    bench.run(2.5)
    bench.hears = False
    answer = bench.ask(Request.RESET, 10.0)
    assert not answer.success
    assert "cable" in answer.message


@pytest.mark.parametrize("connected_s", [0.1, 0.25])
def test_the_first_text_of_a_connection_does_not_show_a_restart(connected_s: float) -> None:
    """The driver's R (reboot) is lost. Then the board sends the connection's first «Paused» text.

    With no earlier text to compare, this text does not show a restart. The reset fails.
    """
    bench = Bench(run=False)
    bench.open()
    bench.run(connected_s)
    assert bench.session.state == "connecting"
    bench.hears = False
    answer = bench.ask(Request.RESET, 10.0)
    assert not answer.success
    assert "cable" in answer.message


def test_lost_texts_do_not_make_a_paused_board_seem_to_have_restarted() -> None:
    """A paused board does not receive the user's reset, and three of its «Paused» texts are lost.

    The reset fails: the number in the next text is too high for a restarted board.
    """
    bench = Bench(run=False)
    bench.open()
    bench.run(2.5)
    bench.hears = False
    bench.session.request(Request.RESET, token := object(), bench.now)
    bench.speaks = False
    bench.run(3.0)
    bench.speaks = True
    bench.run(7.0)
    (done,) = [event for event in bench.events if isinstance(event, RequestDone)]
    assert (done.token, done.success) == (token, False)


def test_a_reset_after_a_pause_that_failed_starts_the_board_again() -> None:
    """After a failed pause, a reset by the user starts the board again.

    The robot does not move until a new command arrives.
    """
    bench = driving()
    bench.hears = False
    bench.ask(Request.PAUSE, 5.0)
    bench.hears = True
    assert bench.ask(Request.RESET, 10.0).message == "running (nominal)"
    bench.run(3.0)
    assert bench.board.mode is BoardMode.NOMINAL
    assert bench.still()
    drive_on(bench)
    assert not bench.still()


@pytest.mark.slow
def test_a_reset_that_fails_as_well_leaves_the_board_to_be_paused(bench: Bench) -> None:
    """The board receives nothing, so a requested pause and then a requested reset fail.

    When the board receives again, the driver pauses it, as the user has requested.
    """
    bench.hears = False
    bench.ask(Request.PAUSE, 5.0)
    assert not bench.ask(Request.RESET, 10.0).success
    bench.hears = True
    with pytest.raises(CommandRefused):
        bench.drive(0.4)
    bench.run(3.0)
    assert bench.board.mode is BoardMode.PAUSED


def test_the_state_does_not_flap_while_a_deaf_board_is_asked_to_reset(bench: Bench) -> None:
    """If a board does not receive R, the state becomes ``connecting`` and then ``nominal`` again.

    It becomes ``nominal`` when the driver has found that the board did not restart.
    """
    bench.hears = False
    bench.events.clear()
    shown = [bench.session.state]
    bench.session.request(Request.RESET, object(), bench.now)
    bench.settle()
    for _ in range(1200):
        shown.append(bench.session.state)
        bench.run(0.01)
    assert [state for state, _ in itertools.groupby(shown)] == ["nominal", "connecting", "nominal"]
    assert [event for event in bench.events if isinstance(event, StateChanged)] == [
        StateChanged("connecting", False),
        StateChanged("nominal", False),
    ]
