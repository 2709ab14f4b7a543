# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the motion rule: only a fresh command moves the robot, and only while data arrives.

A fresh command is younger than the timeout, and newer than the last interruption, such as a pause.
"""

import contextlib
from collections.abc import Callable

import pytest
from robots import drive_on, driving, estop, reconnect
from session_bench import OPENING, STOP, Bench, bare

from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.requests import Request
from omnibot_driver.simulator.omnibot import BoardMode


@pytest.fixture
def bench() -> Bench:
    return driving()


def unpause(bench: Bench) -> None:
    """Pause the board, then resume it before the driver notices, as another program might do."""
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


@pytest.mark.slow
@pytest.mark.parametrize("event", EVENTS.values(), ids=EVENTS)
def test_the_robot_moves_again_only_on_a_command_that_arrived_afterwards(
    bench: Bench, event: Callable[[Bench], object]
) -> None:
    """After an event such as a pause, a restart or an e-stop, the robot needs a new command."""
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
    """A board restarts while its data is lost, and another program starts it at once.

    Only the counters in the board's frames show the restart. The driver discards the current
    command.
    """
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


def test_no_motion_frame_reaches_a_board_that_has_restarted() -> None:
    """A board restarts and boots for 0.4 s, while the user commands motion.

    No motion frame is sent after the boot: the paused board could read a byte of the frame as S
    (start).
    """
    bench = driving(boot_time_s=0.4)
    bench.board.reboot()
    rebooted_at, mark = bench.now, len(bench.written)
    while bench.session.state == "nominal":
        with contextlib.suppress(CommandRefused):
            bench.drive(0.4, 0.0, 0.166)  # 83 LSB: 53 in hexadecimal, S
        bench.run(0.05)
    driven_at = [at for at, data in bench.written[mark:] if bare(data)[:3] == b"\xff\xfe\x01"]
    assert driven_at
    assert max(driven_at) - rebooted_at < 0.32


@pytest.mark.parametrize("request_", [Request.PAUSE, Request.RESET])
def test_from_a_request_on_no_motion_frame_goes_out(bench: Bench, request_: Request) -> None:
    """After a request for a pause or a reset, the driver sends no motion frame.

    In this test, the board does not receive the request, and the robot drives on.
    """
    bench.drive(0.4)
    start = len(bench.written)
    bench.hears = False
    bench.session.request(request_, object(), bench.now)
    bench.settle()
    bench.run(1.0)
    assert b"\xff\xfe\x01" not in bench.written_since(start)


@pytest.mark.parametrize("state", ["connecting", "paused"])
def test_motion_is_refused_unless_the_board_runs(state: str) -> None:
    """Motion commands are refused and not sent while the board is silent or paused.

    A paused board would read a byte 0x52 as the letter R, and reset.
    """
    bench = Bench(run=False)
    bench.open()
    bench.run_until_state(state)
    with pytest.raises(CommandRefused, match="~/start"):
        bench.drive(0.3)
    assert bench.written_since(0) == OPENING


def test_motion_is_refused_without_a_port() -> None:
    """A command arrives before the port is open. The refusal says the board is not connected."""
    with pytest.raises(CommandRefused, match="not connected"):
        Bench().drive(0.3)


def test_the_robot_stands_still_after_the_timeout(bench: Bench) -> None:
    """After the command timeout, the driver sends Stop for 1 s and then nothing."""
    bench.drive(0.5)
    bench.run(0.4)
    assert not bench.still()
    bench.run(1.5)
    assert bench.still()
    start = len(bench.written)
    bench.run(2.0)
    assert bench.written_since(start) == b""


def test_a_robot_that_is_not_heard_is_driven_no_further_and_shows_connecting(bench: Bench) -> None:
    """The board's data is lost while the robot drives. The board still receives commands.

    The driver sends Stop, and later shows the state ``connecting``.
    """
    bench.drive(0.5)
    bench.run(0.1)
    bench.speaks = False
    bench.run(0.25)
    bench.drive(0.5)
    bench.run(0.06)
    assert bench.written[-1][1] == STOP
    with pytest.raises(CommandRefused, match="no data from the board"):
        bench.drive(0.5)
    bench.run(0.4)
    assert bench.still()
    assert bench.session.state == "nominal"
    bench.run(1.0)
    assert bench.session.state == "connecting"
    bench.speaks = True
    bench.run_until_state("nominal")
    bench.run(1.0)
    assert bench.still()


def test_stop_is_sent_also_to_a_board_that_is_not_heard(bench: Bench) -> None:
    """The board is silent but may still receive. The driver sends a user's zero command as Stop."""
    bench.speaks = False
    bench.run(1.45)
    start = len(bench.written)
    bench.drive()
    assert bench.written_since(start) == STOP


def test_a_flood_of_stops_to_a_board_that_is_not_heard_keeps_the_pace(bench: Bench) -> None:
    """A thousand zero commands a second arrive while the board is silent.

    The driver sends only one Stop in each control tick of 10 ms.
    """
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


def test_after_a_cut_in_both_directions_the_robot_is_stopped_before_anything_else(
    bench: Bench,
) -> None:
    """The line is cut in both directions while the robot drives.

    The robot receives nothing and drives on. When the line works again, the driver stops the robot.
    """
    bench.drive(0.5)
    bench.run(0.1)
    bench.speaks = bench.hears = False
    bench.run(5.0)
    assert not bench.still()
    bench.speaks = bench.hears = True
    bench.run(1.0)
    assert bench.still()


def test_a_driver_that_stood_still_has_no_command_and_blames_nobody(bench: Bench) -> None:
    """After a stall of 3 s, the driver sends only Stop until the next command.

    Its only notice says that the driver stalled.
    """
    bench.drive(vx=0.3)
    bench.run(0.2)
    mark = len(bench.written)
    bench.now += 3.0
    bench.session.stood_still(3.0, bench.now)
    bench.session.tick(bench.now)
    bench.settle()
    bench.run(2.0)
    assert {data for _, data in bench.written[mark:]} == {STOP}
    assert bench.still()
    assert bench.notices == ["driver stalled for 3.0 s; robot stopped until the next command"]
    bench.drive(vx=0.3)
    assert bench.board.commands[-1].kind == "velocity"
