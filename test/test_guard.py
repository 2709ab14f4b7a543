# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The guard as a process, on a real pseudo-terminal, with and without its keeper."""

import ast
import contextlib
import os
import select
import signal
import socket
import threading
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from terminal import fill

from omnibot_driver import guard
from omnibot_driver.core.packets import packed
from omnibot_driver.keeper import BEAT_S, HANGS_AFTER, MOST_DYING, Keeper

PATIENCE_S = 20.0
LAST_WORDS = b"these are my last words"
LATCHED_WORDS = b"and these under the e-stop"


class Line:
    """A pseudo-terminal: ``near`` is the driver's port; the far end is read here."""

    def __init__(self) -> None:
        self._far, self.near = os.openpty()
        tty.setraw(self.near)
        os.set_blocking(self.near, False)
        self.heard = b""
        self._others = children()

    def children(self) -> list[int]:
        """The processes begun since this line was made, zombies included."""
        return [pid for pid in children() if pid not in self._others]

    def hear(self, words: bytes) -> bytes:
        """Everything so far, once these words are in it."""
        end = time.monotonic() + PATIENCE_S
        while words not in self.heard:
            assert select.select([self._far], [], [], end - time.monotonic())[0], self.heard
            self.heard += os.read(self._far, 4096)
        return self.heard

    def fill(self) -> None:
        """Fill the terminal's buffer."""
        fill(self.near)

    def hang_up(self) -> None:
        os.close(self._far)
        self._far = -1

    def close(self) -> None:
        os.close(self.near)
        if self._far >= 0:
            os.close(self._far)


@pytest.fixture
def line() -> Iterator[Line]:
    descriptors = len(os.listdir("/proc/self/fd"))
    line = Line()
    yield line
    line.close()
    assert len(os.listdir("/proc/self/fd")) == descriptors
    assert line.children() == [], "a process is left behind, or a zombie"


def children() -> list[int]:
    """Our child processes, zombies included."""
    found = []
    for directory in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            after_name = (directory / "stat").read_text().rpartition(")")[2].split()
            if int(after_name[1]) == os.getpid():
                found.append(int(directory.name))
    return found


def started(pid: int) -> None:
    """Wait until Python has come up in it, and it does not heed SIGTERM any more."""
    end = time.monotonic() + PATIENCE_S
    bit = 1 << (signal.SIGTERM - 1)
    while not int(status_of(pid, "SigIgn"), 16) & bit:
        assert time.monotonic() < end
        time.sleep(0.005)  # what a process ignores changes without an event


def status_of(pid: int, field: str) -> str:
    text = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    return text.partition(f"{field}:")[2].split()[0]


def alive(keeper: Keeper, seconds: float) -> float:
    """Beat as the driver does, whose pace is the thing itself; the longest pause in between."""
    begun_s = beaten_s = time.monotonic()
    longest_s = 0.0
    while (now := time.monotonic()) < begun_s + seconds:
        keeper.beat(now)
        time.sleep(0.05)
        longest_s, beaten_s = max(longest_s, time.monotonic() - beaten_s), now
    return longest_s


def beat_until(keeper: Keeper, predicate: Callable[[], bool]) -> str:
    """Beat as the driver does until the condition holds; returns the messages."""
    told, end = "", time.monotonic() + PATIENCE_S
    while not predicate():
        assert time.monotonic() < end
        told += keeper.beat(time.monotonic())
        time.sleep(0.05)
    return told


def test_a_driver_that_says_good_bye_needs_no_guard(line: Line) -> None:
    """It has stopped the robot itself; not a byte is added."""
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    alive(keeper, 0.2)
    keeper.end(stopped=True)
    keeper.end(stopped=True)
    os.write(line.near, b"end")
    assert line.hear(b"end") == b"end"


def test_a_broken_pipe_brings_the_last_words_again_and_again(line: Line) -> None:
    """For a second, since the board may be deaf just now; then it leaves."""
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    keeper.end(stopped=False)
    assert line.hear(guard.TIMES * LAST_WORDS) == guard.TIMES * LAST_WORDS


def test_missing_heartbeats_bring_the_last_words_until_the_driver_is_heard(line: Line) -> None:
    """It goes on guarding: it stops the robot the next time as well."""
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    longest_s = alive(keeper, 2 * guard.LIMIT_S)
    os.write(line.near, b"so far: ")
    assert line.hear(b"so far: ") == b"so far: " or longest_s > 0.9 * guard.LIMIT_S
    line.hear(b"so far: " + 2 * LAST_WORDS)
    alive(keeper, 2 * guard.LIMIT_S)
    os.write(line.near, b"and again: ")
    heard = line.hear(b"and again: " + LAST_WORDS)
    assert heard.partition(b"and again: ")[0].count(LAST_WORDS) < guard.TIMES
    keeper.end(stopped=True)


def test_words_that_change_are_known_at_once_to_this_guard_and_the_next(line: Line) -> None:
    """What stops a board may depend on what it does just now."""
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
    beat_until(keeper, lambda: line.children() not in ([first], []))
    keeper.end(stopped=False)
    assert b"missing" not in line.hear(2 * b"newest" + b"newest")


def test_words_for_a_guard_that_reads_nothing_are_given_to_another_one(line: Line) -> None:
    """It would say old ones."""
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    (first,) = line.children()
    os.kill(first, signal.SIGSTOP)
    os.waitid(os.P_PID, first, os.WSTOPPED)
    for number in range(200):
        keeper.change(packed(b"%d" % number + bytes(1000)), packed(LATCHED_WORDS))
    keeper.change(packed(b"newest"), packed(LATCHED_WORDS))
    beat_until(keeper, lambda: line.children() not in ([first], []))
    keeper.end(stopped=False)
    assert LAST_WORDS not in line.hear(2 * b"newest")


def test_many_words_are_no_sign_that_a_guard_hangs(line: Line) -> None:
    """It has not come up yet."""
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    children = line.children()
    for number in range(30):
        keeper.change(packed(b"%d" % number), packed(LATCHED_WORDS))
        assert keeper.beat(1000.0) == ""
    assert line.children() == children
    keeper.end(stopped=True)


def test_in_a_full_port_room_is_made_for_the_last_words(line: Line) -> None:
    """Old commands wait there; they are read only after the guard has gone."""
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    line.fill()
    keeper.end(stopped=False)
    line.hear(LAST_WORDS)


def test_a_dead_port_does_not_hold_the_guard(line: Line) -> None:
    """It leaves, and so does the driver."""
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    process = keeper._process
    assert process is not None
    started(process.pid)
    line.hang_up()
    keeper.end(stopped=False)
    assert process.returncode == 0  # it was not killed


def test_a_guard_that_dies_is_told_once_and_replaced(line: Line) -> None:
    """The new one guards."""
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    (first,) = line.children()
    os.kill(first, signal.SIGKILL)
    told = beat_until(keeper, lambda: line.children() not in ([first], []))
    assert "exit code -9" in told
    assert told.count("starting another one") == 1
    (second,) = line.children()
    os.kill(second, signal.SIGKILL)
    assert beat_until(keeper, lambda: line.children() not in ([second], [])) == ""
    keeper.end(stopped=False)
    line.hear(LAST_WORDS)


def test_a_guard_that_cannot_be_started_is_told_and_tried_again(
    line: Line, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The driver drives on without."""
    with monkeypatch.context() as without:
        without.setattr("sys.executable", "/no/python")
        keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
        assert "cannot start the guard process" in keeper.beat(1000.0)
    assert keeper.beat(1000.5) == ""
    assert line.children() == []
    keeper.beat(1001.5)
    keeper.end(stopped=False)
    line.hear(LAST_WORDS)


def test_a_guard_that_hangs_is_told_and_replaced(line: Line) -> None:
    """A stopped guard would not stop the robot; the driver does not wait until its pipe is full."""
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    (first,) = line.children()
    started(first)
    os.kill(first, signal.SIGSTOP)
    os.waitid(os.P_PID, first, os.WSTOPPED)
    assert [keeper.beat(1000.0) for _ in range(HANGS_AFTER)] == [""] * HANGS_AFTER
    assert line.children() == [first]
    assert keeper.beat(1000.0) == "the guard process hung; starting another one"
    beat_until(keeper, lambda: first not in line.children())
    keeper.end(stopped=False)
    line.hear(LAST_WORDS)


def test_a_guard_that_does_not_die_never_holds_up_a_beat(
    line: Line, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in an uninterruptible sleep. It is replaced at once, and reaped later."""
    monkeypatch.setattr("subprocess.Popen.wait", lambda *_: pytest.fail("a beat waits"))
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    (first,) = line.children()
    started(first)
    os.kill(first, signal.SIGSTOP)
    os.waitid(os.P_PID, first, os.WSTOPPED)
    with monkeypatch.context() as undying:
        undying.setattr("subprocess.Popen.kill", lambda _process: None)
        told = [keeper.beat(1000.0 + n * BEAT_S) for n in range(HANGS_AFTER + 2)]
        assert [text for text in told if text] == ["the guard process hung; starting another one"]
        assert len(line.children()) == 2
        assert first in line.children()
    os.kill(first, signal.SIGKILL)
    beat_until(keeper, lambda: first not in line.children())
    monkeypatch.undo()
    keeper.end(stopped=False)
    line.hear(LAST_WORDS)


def test_guards_that_do_not_die_do_not_pile_up(line: Line, monkeypatch: pytest.MonkeyPatch) -> None:
    """More guards would not help on a host where nothing can be killed."""
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    stopped: set[int] = set()
    with monkeypatch.context() as undying:
        undying.setattr("subprocess.Popen.kill", lambda _process: None)
        for second in range(10 * HANGS_AFTER):
            for pid in set(line.children()) - stopped:
                os.kill(pid, signal.SIGSTOP)
                os.waitid(os.P_PID, pid, os.WSTOPPED)
                stopped.add(pid)
            keeper.beat(1000.0 + second)
    assert len(line.children()) == MOST_DYING
    for pid in stopped:
        os.kill(pid, signal.SIGKILL)
    beat_until(keeper, lambda: stopped.isdisjoint(line.children()))
    keeper.end(stopped=False)
    line.hear(LAST_WORDS)


def test_a_guard_that_is_stopped_does_not_hold_up_the_end(line: Line) -> None:
    """It does not hear the good-bye."""
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    (pid,) = line.children()
    os.kill(pid, signal.SIGSTOP)
    keeper.end(stopped=True)


@pytest.mark.filterwarnings("ignore:subprocess .* is still running:ResourceWarning")
def test_a_guard_that_cannot_even_be_killed_does_not_hold_up_the_end(
    line: Line, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A stopped process that no signal reaches stands for an uninterruptible sleep."""
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    (pid,) = line.children()
    os.kill(pid, signal.SIGSTOP)
    monkeypatch.setattr("subprocess.Popen.kill", lambda _process: None)
    ending = threading.Thread(target=keeper.end, kwargs={"stopped": True})
    ending.start()
    ending.join(PATIENCE_S)
    ended = not ending.is_alive()
    os.kill(pid, signal.SIGKILL)
    ending.join()
    with contextlib.suppress(ChildProcessError):
        os.waitpid(pid, 0)
    assert ended


def test_signals_meant_for_the_driver_do_not_end_the_guard(line: Line) -> None:
    """Ctrl-C does not reach its session; SIGTERM to a whole group does, and is not for it."""
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    (pid,) = line.children()
    assert os.getsid(pid) == pid
    started(pid)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        os.kill(pid, number)
    keeper.end(stopped=False)
    line.hear(LAST_WORDS)


def test_who_kills_by_the_drivers_name_does_not_hit_the_guard(line: Line) -> None:
    """``pkill -9 -f omnibot_driver``, in a hurry, while the robot drives."""
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    (pid,) = line.children()
    started(pid)
    _interpreter, *arguments = Path(f"/proc/{pid}/cmdline").read_text().split("\0")
    name = Path(f"/proc/{pid}/comm").read_text()
    keeper.end(stopped=True)
    assert "guard.py" in arguments
    assert "omnibot" not in " ".join([name, *arguments])


def test_the_guard_is_small_and_holds_nothing_but_the_port(line: Line) -> None:
    """It has none of the driver's sockets and files, and few modules of Python."""
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
    """Each line gets its own last words."""
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
    """Each stop is a datagram; lost ones do not end the guard."""
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
    """They are in the guard's pipe before the driver is gone."""
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    keeper.beat(time.monotonic())
    for word in (b"first", b"second", b"newest"):
        keeper.change(packed(word), packed(LATCHED_WORDS))
    keeper.end(stopped=False)
    assert line.hear(guard.TIMES * b"newest") == guard.TIMES * b"newest"


def test_beats_and_words_are_told_apart_however_they_are_read() -> None:
    """Words hold the letter of a latched beat; what is cut is completed by the next read."""
    assert guard.parted(b"..e") == (b"..e", b"", b"")
    assert guard.parted(b".=3:beef 3:00\n.e") == (b"..e", b"3:beef 3:00", b"")
    assert guard.parted(b".=3:be") == (b".", b"", b"=3:be")
    assert guard.parted(b"=3:be" + b"ef 3:00\n=4:01 4:02\n.") == (b".", b"4:01 4:02", b"")
