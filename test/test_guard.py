# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the guard, the separate process that stops the robot if the driver cannot.

The board is replaced by a real pseudo-terminal.
"""

import ast
import os
import signal
import socket
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from guarded_line import (
    EARLY_S,
    LAST_WORDS,
    LATCHED_WORDS,
    PATIENCE_S,
    Line,
    alive,
    beat_until,
    replaced,
    started,
    status_of,
)

from omnibot_driver import guard
from omnibot_driver.core.packets import packed
from omnibot_driver.keeper import Keeper

pytestmark = pytest.mark.usefixtures("no_guard_is_killed_while_it_speaks")


def test_a_driver_that_says_good_bye_needs_no_guard(line: Line) -> None:
    """The driver has stopped the robot itself and ends. The guard process writes nothing."""
    begun_s = time.monotonic()
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    alive(keeper, 0.2)
    keeper.end(stopped=True)
    took_s = time.monotonic() - begun_s
    keeper.end(stopped=True)
    os.write(line.near, b"end")
    # If this computer stalls, the guard rightly speaks before the end.
    assert line.hear(b"end") == b"end" or took_s > 0.9 * guard.LIMIT_S


def test_a_broken_pipe_brings_the_last_words_again_and_again(line: Line) -> None:
    """The pipe from the driver to the guard breaks.

    The guard repeats the stop bytes, because the first ones may be lost. Then the guard ends.
    """
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    keeper.end(stopped=False)
    assert line.hear(guard.TIMES * LAST_WORDS) == guard.TIMES * LAST_WORDS


def test_missing_heartbeats_bring_the_last_words_until_the_driver_is_heard(line: Line) -> None:
    """If the driver's heartbeats stop, the guard process writes stop bytes to the board.

    When heartbeats arrive again, the guard process stops writing, and waits.
    """
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    longest_s = alive(keeper, 2 * guard.LIMIT_S)
    beaten_s = time.monotonic()
    os.write(line.near, b"so far: ")
    assert line.hear(b"so far: ") == b"so far: " or longest_s > 0.9 * guard.LIMIT_S
    line.hear(b"so far: " + 2 * LAST_WORDS)
    keeper.beat(time.monotonic())
    silence_s = time.monotonic() - beaten_s
    longest_s = alive(keeper, 2 * guard.LIMIT_S)
    os.write(line.near, b"and again: ")
    heard = line.hear(b"and again: " + LAST_WORDS)
    count = heard.partition(b"and again: ")[0].count(LAST_WORDS)
    late = silence_s > guard.LIMIT_S + 0.8 * guard.TIMES * guard.PACE_S
    assert count < guard.TIMES or late or longest_s > 0.9 * guard.LIMIT_S
    keeper.end(stopped=True)


def test_words_that_change_are_known_at_once_to_this_guard_and_the_next(line: Line) -> None:
    """The guard process, and its replacement, write the newest stop bytes from the driver."""
    keeper = Keeper([line.near, None], packed(LAST_WORDS), packed(LATCHED_WORDS))
    words = packed(b"other words"), packed(b"other latched words")
    keeper.change(*words)
    assert keeper.last_words == words
    assert keeper.beat(time.monotonic(), latched=True) == ""
    (first,) = line.children()
    started(first)
    keeper.change(packed(b"newest") + packed(b"missing", 1), packed(b"newest latched"))
    os.kill(first, signal.SIGSTOP)
    os.kill(first, signal.SIGCONT)
    line.hear(2 * b"newest latched")  # no heartbeat comes
    assert LAST_WORDS not in line.heard
    os.kill(first, signal.SIGKILL)
    beat_until(keeper, lambda: replaced(line, first))
    keeper.end(stopped=False)
    assert b"missing" not in line.hear(2 * b"newest" + b"newest")


def test_the_last_packets_of_an_orderly_end_are_not_discarded(
    line: Line, monkeypatch: pytest.MonkeyPatch
) -> None:
    """If the driver ends without a proof of a stop, the guard repeats Stop and discards nothing.

    The last packets, such as a pause, may still wait in the kernel.
    """
    reading, writing = os.pipe()
    process = SimpleNamespace(stdin=os.fdopen(writing, "wb", 0), wait=lambda _within_s: 0)
    monkeypatch.setattr("subprocess.Popen", lambda *_arguments, **_options: process)
    monkeypatch.setattr(guard, "DRIVER", reading)
    monkeypatch.setattr(guard, "PACE_S", 0.0)
    discarded: list[int] = []
    monkeypatch.setattr(guard, "drop_what_waits", discarded.append)
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    keeper.beat(EARLY_S, latched=True)
    keeper.end(stopped=False, written=True)
    guard.watch([(line.near, LAST_WORDS)], [(line.near, LATCHED_WORDS)])
    os.close(reading)
    assert not discarded
    assert line.hear(guard.TIMES * LATCHED_WORDS) == guard.TIMES * LATCHED_WORDS


def test_in_a_full_port_room_is_made_for_the_last_words(line: Line) -> None:
    """Old commands fill the port's buffer. The guard process discards them, so the stop bytes fit.

    The test reads the stop bytes only after the guard process has ended.
    """
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    line.fill()
    keeper.end(stopped=False)
    line.hear(LAST_WORDS)


def test_a_dead_port_does_not_hold_the_guard(line: Line) -> None:
    """The guard's port has failed. The guard ends by itself, so the driver need not kill it."""
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    process = keeper._process
    assert process is not None
    started(process.pid)
    line.hang_up()
    keeper.end(stopped=False)
    assert process.returncode == 0  # it was not killed


def test_signals_meant_for_the_driver_do_not_end_the_guard(line: Line) -> None:
    """The guard process ignores signals that usually end a process.

    Ctrl-C in the driver's terminal does not even reach it, because the guard process has its own
    session.
    """
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    (pid,) = line.children()
    assert os.getsid(pid) == pid
    started(pid)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        os.kill(pid, number)
    keeper.end(stopped=False)
    line.hear(LAST_WORDS)


def test_who_kills_by_the_drivers_name_does_not_hit_the_guard(
    line: Line, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """``pkill -9 -f omnibot_driver`` kills the driver, but not its guard.

    The guard's command line has no "omnibot", whatever the interpreter's path.
    """
    interpreter = tmp_path / "omnibot_driver" / ".venv" / "bin" / "python"
    interpreter.parent.mkdir(parents=True)
    interpreter.symlink_to(sys.executable)
    monkeypatch.setattr(sys, "executable", str(interpreter))
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    (pid,) = line.children()
    started(pid)
    arguments = Path(f"/proc/{pid}/cmdline").read_text().split("\0")
    name = Path(f"/proc/{pid}/comm").read_text()
    keeper.end(stopped=True)
    assert "guard.py" in arguments
    assert "omnibot" not in " ".join([name, *arguments])


def test_the_guard_is_small_and_holds_nothing_but_the_port(line: Line) -> None:
    """The guard process has none of the driver's sockets and files, and imports few modules."""
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    (pid,) = line.children()
    started(pid)
    opened = [os.readlink(entry) for entry in Path(f"/proc/{pid}/fd").iterdir()]
    resident_kb = int(status_of(pid, "VmRSS"))
    keeper.end(stopped=True)
    assert sorted(name.partition(":")[0] for name in opened) == [
        *["/dev/null"] * 2,
        os.ttyname(line.near),
        "pipe",
    ]
    assert resident_kb < 14_000
    tree = ast.parse(Path(guard.__file__).read_text(encoding="utf-8"))
    imported = {
        alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.Import)
        for alias in node.names
    }
    assert imported == {"_signal", "errno", "os", "select", "sys", "termios"}
    assert not any(isinstance(node, ast.ImportFrom) for node in ast.walk(tree))


def test_two_lines_are_both_stopped_and_one_that_is_gone_keeps_none_from_it(line: Line) -> None:
    """The guard process stops the robot on one line, although the board's other line is gone.

    Each line gets only its own stop bytes.
    """
    other = Line()
    try:
        words = ((0, b"drive stands"), (1, b"front stands"))
        keeper = Keeper([line.near, other.near], words, words)
        line.hang_up()
        keeper.end(stopped=False)
        assert b"drive" not in other.hear(b"front stands")
        os.write(other.near, b"end")
        assert other.hear(b"end").count(b"front stands") == guard.TIMES
    finally:
        other.close()


def test_a_host_of_datagrams_is_stopped_also_if_it_begins_to_listen_late() -> None:
    """The board's UDP port is closed at first. The guard repeats the stop bytes.

    So some of them arrive after the port has opened.
    """
    host = socket.socket(type=socket.SOCK_DGRAM)
    host.bind(("127.0.0.1", 0))
    address = host.getsockname()
    driver = socket.socket(type=socket.SOCK_DGRAM)
    driver.connect(address)
    keeper = Keeper([driver.fileno()], packed(b"SM"), packed(b"ES"))
    host.close()
    late = threading.Timer(0.0, keeper.end, kwargs={"stopped": False})
    late.start()
    with socket.socket(type=socket.SOCK_DGRAM) as again:
        again.bind(address)
        again.settimeout(PATIENCE_S)
        assert again.recv(99) == b"SM"
    late.join()
    driver.close()


def test_words_that_were_replaced_are_the_last_ones(line: Line) -> None:
    """The driver replaces the stop bytes several times, and then ends.

    The guard process writes only the newest stop bytes.
    """
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    keeper.beat(time.monotonic())
    for word in (b"first", b"second", b"newest"):
        keeper.change(packed(word), packed(LATCHED_WORDS))
    keeper.end(stopped=False)
    assert line.hear(guard.TIMES * b"newest") == guard.TIMES * b"newest"


def test_beats_and_words_are_told_apart_however_they_are_read() -> None:
    """The guard distinguishes heartbeats from stop bytes in one pipe, wherever a read ends.

    An ``e`` in the stop bytes is a hexadecimal digit. Any other ``e`` is a heartbeat of a driver
    whose e-stop is latched.
    """
    assert guard.parted(b"..e") == (b"..e", b"", b"")
    assert guard.parted(b".=3:beef 3:00\n.e") == (b"..e", b"3:beef 3:00", b"")
    assert guard.parted(b".=3:be") == (b".", b"", b"=3:be")
    assert guard.parted(b"=3:be" + b"ef 3:00\n=4:01 4:02\n.") == (b".", b"4:01 4:02", b"")
