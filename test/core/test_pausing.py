# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of pausing with the letter P, which also resumes a paused board.

So the driver sends P only after new data of a running board. Only a new «Paused» text confirms a
pause.
"""

import pytest
from robots import drive_on, paused, standing
from session_bench import PAUSE, STOP, Bench

from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.requests import Request, RequestDone
from omnibot_driver.simulator.omnibot import BoardMode


@pytest.fixture
def bench() -> Bench:
    return standing()


def test_pausing_sends_stop_then_one_p_and_is_confirmed_by_the_notice(bench: Bench) -> None:
    """The user requests a pause while the robot drives.

    The driver sends Stop, then P once. The board's «Paused» text confirms the pause.
    """
    bench.drive(0.5)
    bench.run(0.3)
    start = len(bench.written)
    answer = bench.ask(Request.PAUSE, 5.0)
    assert answer.success
    assert bench.board.mode is BoardMode.PAUSED
    assert bench.session.state == "paused"
    assert bench.written_since(start) == STOP + STOP + PAUSE


def test_pausing_twice_does_not_toggle(bench: Bench) -> None:
    """If the user pauses a paused board, the driver sends no P, because P would resume it.

    A new «Paused» text of the board confirms the request.
    """
    bench.ask(Request.PAUSE, 5.0)
    start, asked_at = len(bench.written), bench.now
    answer = bench.ask(Request.PAUSE, 5.0)
    assert answer.success
    assert bench.now > asked_at
    assert b"P" not in bench.written_since(start)
    assert bench.board.mode is BoardMode.PAUSED


def test_pausing_a_board_that_somebody_else_has_just_paused_does_not_unpause_it(
    bench: Bench,
) -> None:
    """Another program pauses the board. Then the driver gets a request for a pause.

    The driver sends no P, because P would start the paused board again.
    """
    bench.board.receive(b"P")
    assert bench.session.state == "nominal"
    assert bench.ask(Request.PAUSE, 5.0).success
    bench.run(1.0)
    assert bench.board.mode is BoardMode.PAUSED


def test_a_lost_p_is_said_again(bench: Bench) -> None:
    """P is lost, so the board keeps sending data. A paused board would send only its «Paused» text.

    The driver sends P again.
    """
    bench.hears = False
    bench.session.request(Request.PAUSE, token := object(), bench.now)
    bench.settle()
    bench.run(0.5)
    bench.hears = True
    bench.run(2.0)
    assert RequestDone(token, True, "paused") in bench.events
    assert bench.board.mode is BoardMode.PAUSED


def test_a_pause_whose_p_crosses_a_notice_says_so_only_when_the_board_is_paused(
    bench: Bench,
) -> None:
    """Another program pauses the board, and then the driver's P resumes the board.

    The late «Paused» text of the first pause does not confirm the user's request for a pause. So
    the driver sends P again.
    """
    data = bench.board.step()
    bench.board.receive(b"P")
    notice = bench.board.step()
    assert notice.startswith(b"Paused")
    bench.session.request(Request.PAUSE, token := object(), bench.now)
    for late in (data, notice):
        bench.settle()
        bench.session.inbound.receive(late, bench.now)
    bench.settle()
    assert bench.board.mode is BoardMode.NOMINAL
    asked_at, done = bench.now, RequestDone(token, True, "paused")
    while done not in bench.events:
        assert bench.now < asked_at + 5.0
        bench.run(0.01)
    assert bench.board.mode is BoardMode.PAUSED
    bench.run(3.0)
    assert bench.board.mode is BoardMode.PAUSED


def test_a_pause_whose_request_crosses_a_notice_says_so_only_when_the_board_is_paused() -> None:
    """A «Paused» text that the board sent before a start does not confirm a later pause.

    The user starts the paused board, and then requests a pause. The text arrives only after this
    request.
    """
    bench = paused()
    notice = b""
    while not notice:
        notice = bench.board.step()
    bench.session.request(Request.START, object(), bench.now)
    bench.settle()
    bench.run(0.2)
    bench.session.request(Request.PAUSE, token := object(), bench.now)
    bench.settle()
    bench.session.inbound.receive(notice, bench.now)
    bench.settle()
    asked_at, done = bench.now, RequestDone(token, True, "paused")
    while done not in bench.events:
        assert bench.now < asked_at + 5.0
        bench.run(0.01)
    assert bench.board.mode is BoardMode.PAUSED


def test_a_host_that_slept_does_not_take_old_data_for_a_lost_p(bench: Bench) -> None:
    """After P, the host sleeps for 3 s. Then it reads data that the board sent before P.

    The driver does not conclude from this data that P was lost.
    """
    on_its_way = b"".join(bench.board.step() for _ in range(10))
    bench.session.request(Request.PAUSE, token := object(), bench.now)
    bench.session.inbound.receive(on_its_way[:80], bench.now)
    bench.settle()
    assert bench.board.mode is BoardMode.PAUSED
    backlog = on_its_way[80:] + b"".join(bench.board.step() for _ in range(300))
    bench.now += 3.0
    for byte in backlog:
        bench.session.inbound.receive(bytes([byte]), bench.now)
        bench.settle()
    bench.run(0.2)
    assert RequestDone(token, True, "paused") in bench.events
    assert [command.kind for command in bench.board.commands].count("pause") == 1


def test_after_a_failed_pause_the_robot_stands_until_start(bench: Bench) -> None:
    """The board does not receive P, so the pause fails.

    The driver then refuses motion until ~/start. It also repeats the pause, so the board is paused
    when it receives again.
    """
    bench.hears = False
    answer = bench.ask(Request.PAUSE, 5.0)
    assert not answer.success
    assert "the driver repeats the pause" in answer.message
    assert "until ~/start" in answer.message
    with pytest.raises(CommandRefused, match="being paused; call ~/start"):
        bench.drive(0.4)
    bench.hears = True
    bench.run(3.0)
    assert bench.board.mode is BoardMode.PAUSED
    assert bench.session.state == "paused"


def test_a_start_ends_a_pause_that_failed(bench: Bench) -> None:
    """A pause has failed, and the user calls ~/start. The driver does not repeat the pause.

    A fresh command moves the robot.
    """
    bench.hears = False
    bench.ask(Request.PAUSE, 5.0)
    bench.hears = True
    start = len(bench.written)
    assert bench.ask(Request.START, 5.0).message == "running (nominal)"
    bench.run(3.0)
    assert b"P" not in bench.written_since(start)
    assert bench.board.mode is BoardMode.NOMINAL
    drive_on(bench)
    assert not bench.still()


def test_a_paused_board_that_somebody_else_starts_is_paused_again(bench: Bench) -> None:
    """Another program starts a board that the user has paused.

    The driver pauses it again, and still refuses motion.
    """
    assert bench.ask(Request.PAUSE, 5.0).success
    bench.board.receive(b"S")
    bench.run(0.2)
    with pytest.raises(CommandRefused):
        bench.drive(0.4)
    bench.run(3.0)
    assert bench.board.mode is BoardMode.PAUSED
