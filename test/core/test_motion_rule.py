# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The one motion rule, the e-stop, and what is done about a robot that does not obey."""

import contextlib
import itertools
from collections.abc import Callable

import pytest
from bench import EMERGENCY_STOP, OPENING, STOP, Bench

from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.events import StateChanged
from omnibot_driver.core.supervisor import Request, RequestDone
from omnibot_driver.simulator import BoardMode, BoardSettings


def driving(**settings: object) -> Bench:
    """A board that carries out 0.4 m/s, commanded just now."""
    bench = Bench(BoardSettings(running=True, **settings))  # type: ignore[arg-type]
    bench.open()
    bench.run_until_state("nominal")
    bench.run(1.5)
    drive_on(bench)
    assert not bench.still()
    return bench


@pytest.fixture
def bench() -> Bench:
    return driving()


def drive_on(bench: Bench) -> None:
    for _ in range(5):
        bench.drive(0.4)
        bench.run(0.1)


def estop(bench: Bench, active: bool) -> str:
    said = bench.session.estop(active, bench.now)
    bench.settle()
    return said


def reconnect(bench: Bench) -> None:
    bench.close()
    bench.open()


def unpause(bench: Bench) -> None:
    """Paused by somebody else, and un-paused again before anybody has noticed."""
    bench.board.receive(b"P")
    bench.run(0.02)
    bench.board.receive(b"P")


EVENTS: dict[str, Callable[[Bench], object]] = {
    "reset": lambda bench: bench.ask(Request.RESET, 10.0),
    "pause and un-pause": lambda bench: (
        bench.ask(Request.PAUSE, 5.0),
        bench.ask(Request.START, 5.0),
    ),
    "pause and un-pause by somebody else": unpause,
    "restart of the board": lambda bench: bench.board.reboot(),
    "reconnect": reconnect,
    "e-stop and release": lambda bench: (estop(bench, True), estop(bench, False)),
}


@pytest.mark.parametrize("event", EVENTS.values(), ids=EVENTS)
def test_the_robot_moves_again_only_on_a_command_that_arrived_afterwards(
    bench: Bench, event: Callable[[Bench], object]
) -> None:
    """Whatever the board did with what it had been told before."""
    bench.drive(0.4)
    event(bench)
    bench.run(3.0)
    assert bench.session.state == "nominal"
    assert bench.still()
    start, before = len(bench.written), bench.board.truth.x_m
    bench.run(2.0)
    assert b"\xff\xfe\x01" not in bench.written_since(start)
    assert bench.board.truth.x_m == before
    drive_on(bench)
    assert not bench.still()


def test_a_restart_that_only_the_counters_tell_discards_the_command(bench: Bench) -> None:
    """It booted and was started within a moment, and no notice was heard."""
    bench = driving(boot_time_s=0.05)
    bench.drive(0.4)
    bench.speaks = False
    bench.board.reboot()
    bench.run(0.07)
    bench.board.receive(b"\0\0\0S")
    assert bench.board.mode is BoardMode.NOMINAL
    bench.speaks = True
    bench.run(0.15)
    assert bench.written[-1][1] == STOP
    start = len(bench.written)
    bench.run(1.0)
    assert b"\xff\xfe\x01" not in bench.written_since(start)
    drive_on(bench)
    assert not bench.still()


@pytest.mark.parametrize("request_", [Request.PAUSE, Request.RESET])
def test_from_a_request_on_no_motion_frame_goes_out(bench: Bench, request_: Request) -> None:
    """Also where the board does not hear it and drives on."""
    bench.drive(0.4)
    start = len(bench.written)
    bench.hears = False
    bench.session.request(request_, object(), bench.now)
    bench.settle()
    bench.run(1.0)
    assert b"\xff\xfe\x01" not in bench.written_since(start)


# E-stop


def test_an_estop_is_the_first_frame_that_a_reconnected_board_hears_after_the_opening(
    bench: Bench,
) -> None:
    """Latched while there was no port; the answer says so."""
    bench.close()
    assert "port is not open" in estop(bench, True)
    start = len(bench.written)
    bench.open()
    assert bench.written_since(start) == OPENING + b"S" + EMERGENCY_STOP
    bench.run(2.0)
    assert bench.still()


def test_only_a_release_ends_an_estop_and_a_command_from_before_it_is_worth_nothing(
    bench: Bench,
) -> None:
    """A hundred commands under the latch, and nothing moves when it is let go."""
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
    """Released and commanded, it stands: after a second the driver says so, once; a reset helps."""
    bench = driving(estop_latches=True)
    estop(bench, True)
    bench.run(1.0)
    estop(bench, False)
    for _ in range(8):
        drive_on(bench)
    assert bench.still()
    assert [text for text in bench.notices if "~/reset" in text] == bench.notices
    assert len(bench.notices) == 1
    assert bench.ask(Request.RESET, 10.0).success
    drive_on(bench)
    assert not bench.still()
    assert len(bench.notices) == 1


def test_an_estop_that_nobody_may_have_heard_says_so(bench: Bench) -> None:
    """It is latched and sent, but not a byte has come from the board for a while."""
    assert estop(bench, True) == "e-stop latched"
    bench.speaks = False
    bench.run(2.0)
    assert "nobody knows" in estop(bench, True)
    bench.close()
    assert "not open" in estop(bench, True)


def test_a_board_that_does_not_hold_the_estop_gives_no_notice(bench: Bench) -> None:
    """Speeding up takes its time, and that is all."""
    for _ in range(3):
        estop(bench, True)
        bench.run(0.5)
        estop(bench, False)
        for _ in range(4):
            drive_on(bench)
    assert bench.notices == []


# A robot that does not do what it is told


def test_a_robot_that_is_commanded_and_does_not_move_is_told_of_once() -> None:
    """Blocked wheels, no motor power, or a switch that stands on position."""
    bench = Bench(BoardSettings(running=True, control="position"), control="velocity")
    bench.open()
    bench.run(1.5)
    for _ in range(10):
        drive_on(bench)
    assert len(bench.notices) == 1
    assert "`control_method`" in bench.notices[0]


def test_a_slow_command_and_a_command_to_stand_prove_nothing(bench: Bench) -> None:
    """Within the noise nobody can tell."""
    for _ in range(40):
        bench.drive(0.001, 0.0, 0.01)
        bench.run(0.1)
    for _ in range(40):
        bench.drive()
        bench.run(0.1)
    assert bench.notices == []


def test_in_imu_only_mode_nothing_is_found() -> None:
    """No displacement tells anything."""
    bench = Bench(BoardSettings(running=True, imu_only=True))
    bench.open()
    bench.run_until_state("imu_only")
    for _ in range(10):
        drive_on(bench)
    bench.run(5.0)
    assert bench.notices == []


def test_a_robot_that_did_not_hear_stop_is_stopped_when_it_can_hear_again(bench: Bench) -> None:
    """The cut outlasts the second of Stops; its deltas show that it drives on."""
    bench.hears = False
    bench.run(6.0)
    assert not bench.still()
    assert len([text for text in bench.notices if "although it is to stand" in text]) == 1
    bench.hears = True
    bench.run(0.5)
    assert bench.still()
    start = len(bench.written)
    bench.run(3.0)
    start = len(bench.written)
    bench.run(3.0)
    assert bench.written_since(start) == b""


def test_a_robot_that_rolls_out_or_is_nudged_makes_no_notice(bench: Bench) -> None:
    """Standing takes a moment."""
    bench.run(4.0)
    assert bench.notices == []


def test_the_stops_for_a_robot_that_moves_unbidden_do_not_hinder_the_next_command(
    bench: Bench,
) -> None:
    """They are harmless, and a command replaces them."""
    bench.hears = False
    bench.run(4.0)
    bench.hears = True
    drive_on(bench)
    assert not bench.still()
    assert bench.written[-1][1] != STOP


def test_a_flood_of_stops_to_a_board_that_is_not_heard_keeps_the_pace(bench: Bench) -> None:
    """A thousand zeros a second are still no more than one Stop per control tick."""
    bench.speaks = False
    bench.run(0.5)
    start = len(bench.written)
    for _ in range(200):
        bench.now += 0.001
        bench.drive()
        if bench.now >= bench.session.wake_at:
            bench.session.tick(bench.now)
            bench.settle()
    assert 15 <= len(bench.written) - start <= 22


# Failures


def test_after_a_failed_pause_the_robot_stands_until_start(bench: Bench) -> None:
    """Somebody wanted it to be still: P goes on, motion is refused, and the sentence says so."""
    bench.hears = False
    answer = bench.ask(Request.PAUSE, 5.0)
    assert not answer.success
    assert "until ~/start" in answer.message
    with pytest.raises(CommandRefused, match="being paused; the service ~/start"):
        bench.drive(0.4)
    bench.hears = True
    bench.run(3.0)
    assert bench.board.mode is BoardMode.PAUSED
    assert bench.session.state == "paused"


def test_a_start_ends_a_pause_that_failed(bench: Bench) -> None:
    """And a fresh command moves it again."""
    bench.hears = False
    bench.ask(Request.PAUSE, 5.0)
    bench.hears = True
    assert bench.ask(Request.START, 5.0).success
    bench.run(3.0)
    assert bench.board.mode is BoardMode.NOMINAL
    drive_on(bench)
    assert not bench.still()


def test_a_reset_after_a_pause_that_failed_starts_the_board_again(bench: Bench) -> None:
    """It ran before the reset, so it runs after it; the robot stands until a fresh command."""
    bench.hears = False
    bench.ask(Request.PAUSE, 5.0)
    bench.hears = True
    assert bench.ask(Request.RESET, 10.0).message == "running (nominal)"
    bench.run(3.0)
    assert bench.board.mode is BoardMode.NOMINAL
    assert bench.still()
    drive_on(bench)
    assert not bench.still()


def test_a_reset_that_fails_as_well_leaves_the_board_to_be_paused(bench: Bench) -> None:
    """Nothing has restarted, so the pause that somebody wanted is still wanted."""
    bench.hears = False
    bench.ask(Request.PAUSE, 5.0)
    assert not bench.ask(Request.RESET, 10.0).success
    bench.hears = True
    with pytest.raises(CommandRefused):
        bench.drive(0.4)
    bench.run(3.0)
    assert bench.board.mode is BoardMode.PAUSED


def test_a_reset_of_a_paused_board_leaves_it_paused(bench: Bench) -> None:
    """And says so."""
    assert bench.ask(Request.PAUSE, 5.0).success
    answer = bench.ask(Request.RESET, 10.0)
    assert answer.success
    assert "paused, as it was" in answer.message
    bench.run(3.0)
    assert bench.board.mode is BoardMode.PAUSED


def test_a_paused_board_that_somebody_else_starts_is_paused_again(bench: Bench) -> None:
    """It was asked to be paused; meanwhile motion is refused."""
    assert bench.ask(Request.PAUSE, 5.0).success
    bench.board.receive(b"S")
    bench.run(0.2)
    with pytest.raises(CommandRefused):
        bench.drive(0.4)
    bench.run(3.0)
    assert bench.board.mode is BoardMode.PAUSED


def test_a_pause_whose_p_crosses_a_notice_says_so_only_when_the_board_is_paused(
    bench: Bench,
) -> None:
    """Somebody else has just paused it: our P, sent for data from before, un-pauses it."""
    data = bench.board.step()
    bench.board.receive(b"P")
    notice = bench.board.step()
    assert notice.startswith(b"Paused")
    bench.session.request(Request.PAUSE, token := object(), bench.now)
    for late in (data, notice):
        bench.settle()
        bench.session.receive(late, bench.now)
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
    """S is in flight, and the notice was sent before it was obeyed."""
    bench = Bench(run=False)
    bench.open()
    bench.run_until_state("paused")
    notice = b""
    while not notice:
        notice = bench.board.step()
    bench.session.request(Request.START, object(), bench.now)
    bench.settle()
    bench.run(0.2)
    bench.session.request(Request.PAUSE, token := object(), bench.now)
    bench.settle()
    bench.session.receive(notice, bench.now)
    bench.settle()
    asked_at, done = bench.now, RequestDone(token, True, "paused")
    while done not in bench.events:
        assert bench.now < asked_at + 5.0
        bench.run(0.01)
    assert bench.board.mode is BoardMode.PAUSED


def test_a_host_that_slept_does_not_take_old_data_for_a_lost_p(bench: Bench) -> None:
    """It said P and slept for three seconds; what it reads then was sent before P was obeyed."""
    on_its_way = b"".join(bench.board.step() for _ in range(10))
    bench.session.request(Request.PAUSE, token := object(), bench.now)
    bench.session.receive(on_its_way[:80], bench.now)
    bench.settle()
    assert bench.board.mode is BoardMode.PAUSED
    backlog = on_its_way[80:] + b"".join(bench.board.step() for _ in range(300))
    bench.now += 3.0
    for byte in backlog:
        bench.session.receive(bytes([byte]), bench.now)
        bench.settle()
    bench.run(0.2)
    assert RequestDone(token, True, "paused") in bench.events
    assert [command.kind for command in bench.board.commands].count("pause") == 1


def test_the_state_does_not_flap_while_a_deaf_board_is_asked_to_reset(bench: Bench) -> None:
    """Connecting, until it is known that it has not restarted."""
    bench.hears = False
    shown = [bench.session.state]
    bench.session.request(Request.RESET, object(), bench.now)
    bench.settle()
    for _ in range(1200):
        shown.append(bench.session.state)
        bench.run(0.01)
    assert [state for state, _ in itertools.groupby(shown)] == ["nominal", "connecting", "nominal"]
    assert bench.events.count(StateChanged()) <= 4


def test_no_motion_frame_reaches_a_board_that_has_restarted() -> None:
    """Silence ends the command sooner than a board can boot: its words may hide letters."""
    bench = driving(boot_time_s=0.4)
    bench.board.reboot()
    rebooted_at, mark = bench.now, len(bench.written)
    while bench.session.state == "nominal":
        with contextlib.suppress(CommandRefused):
            bench.drive(0.4, 0.0, 0.166)  # 83 LSB: 53 in hexadecimal, S
        bench.run(0.05)
    driven_at = [at for at, data in bench.written[mark:] if data[:3] == b"\xff\xfe\x01"]
    assert driven_at
    assert max(driven_at) - rebooted_at < 0.32
