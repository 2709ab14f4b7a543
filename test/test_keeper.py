# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of guards that end, hang, or cannot be started.

A guard is a process that stops the robot if the driver cannot. The driver replaces a failed guard
without waiting for its end.
"""

import contextlib
import os
import signal
import threading

import pytest
from guarded_line import (
    EARLY_S,
    LAST_WORDS,
    LATCHED_WORDS,
    PATIENCE_S,
    Line,
    beat_until,
    replaced,
    started,
)

from omnibot_driver.core.packets import packed
from omnibot_driver.keeper import BEAT_S, HANGS_AFTER, Keeper

pytestmark = pytest.mark.usefixtures("no_guard_is_killed_while_it_speaks")


def test_words_for_a_guard_that_reads_nothing_are_given_to_another_one(line: Line) -> None:
    """A suspended guard process does not read the new stop bytes, so the driver replaces it.

    Without the replacement, the suspended guard would later write outdated stop bytes.
    """
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    (first,) = line.children()
    os.kill(first, signal.SIGSTOP)
    os.waitid(os.P_PID, first, os.WSTOPPED)
    for number in range(200):
        keeper.change(packed(b"%d" % number + bytes(1000)), packed(LATCHED_WORDS))
    keeper.change(packed(b"newest"), packed(LATCHED_WORDS))
    beat_until(keeper, lambda: replaced(line, first))
    keeper.end(stopped=False)
    assert LAST_WORDS not in line.hear(2 * b"newest")


def test_many_words_are_no_sign_that_a_guard_hangs(line: Line) -> None:
    """A guard process is starting and reads nothing yet. The driver changes the stop bytes often.

    The driver does not conclude from the many unread bytes that the guard hangs.
    """
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    children = line.children()
    for number in range(30):
        keeper.change(packed(b"%d" % number), packed(LATCHED_WORDS))
        assert keeper.beat(EARLY_S) == ""
    assert line.children() == children
    keeper.end(stopped=True)


def test_a_guard_that_dies_is_told_once_and_replaced(line: Line) -> None:
    """Two guards end early. The driver replaces each, but reports only the end of the first one."""
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    (first,) = line.children()
    os.kill(first, signal.SIGKILL)
    os.waitid(os.P_PID, first, os.WEXITED | os.WNOWAIT)
    told = beat_until(keeper, lambda: replaced(line, first))
    assert "exit code -9" in told
    assert told.count("starting another guard process") == 1
    (second,) = line.children()
    os.kill(second, signal.SIGKILL)
    assert beat_until(keeper, lambda: replaced(line, second)) == ""
    keeper.end(stopped=False)
    line.hear(LAST_WORDS)


def test_a_guard_that_cannot_be_started_is_told_and_tried_again(
    line: Line, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A guard process cannot be started. The driver reports this and tries again later."""
    with monkeypatch.context() as without:
        without.setattr("sys.executable", "/no/python")
        keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
        assert "cannot start the guard process" in keeper.beat(EARLY_S)
    assert keeper.beat(EARLY_S + 0.5) == ""
    assert line.children() == []
    keeper.beat(EARLY_S + 1.5)
    keeper.end(stopped=False)
    line.hear(LAST_WORDS)


def test_a_dead_guard_that_cannot_be_replaced_is_told_as_well(
    line: Line, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A guard dies, and the driver reports that it starts another one. This start fails.

    The driver reports the failure, too: the first report alone would be false.
    """
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    (first,) = line.children()
    with monkeypatch.context() as without:
        without.setattr("sys.executable", "/no/python")
        os.kill(first, signal.SIGKILL)
        os.waitid(os.P_PID, first, os.WEXITED | os.WNOWAIT)
        told = [keeper.beat(EARLY_S + n * BEAT_S) for n in range(30)]
    assert "exit code -9" in "".join(told)
    assert "".join(told).count("cannot start the guard process") == 1
    assert line.children() == []
    keeper.end(stopped=True)


def test_a_guard_that_hangs_is_told_and_replaced(line: Line) -> None:
    """A guard process hangs and does not read its heartbeats.

    The driver replaces the guard before the pipe with the heartbeats is full.
    """
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    (first,) = line.children()
    started(first)
    os.kill(first, signal.SIGSTOP)
    os.waitid(os.P_PID, first, os.WSTOPPED)
    assert [keeper.beat(EARLY_S) for _ in range(HANGS_AFTER)] == [""] * HANGS_AFTER
    assert line.children() == [first]
    assert keeper.beat(EARLY_S) == "the guard process hung; starting another guard process"
    beat_until(keeper, lambda: first not in line.children())
    keeper.end(stopped=False)
    line.hear(LAST_WORDS)


def test_a_guard_that_does_not_die_never_holds_up_a_beat(
    line: Line, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A guard process hangs and cannot be killed. The driver starts another guard at once.

    The driver does not wait for the end of the first guard.
    """
    monkeypatch.setattr("subprocess.Popen.wait", lambda *_: pytest.fail("a beat waits"))
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    (first,) = line.children()
    started(first)
    os.kill(first, signal.SIGSTOP)
    os.waitid(os.P_PID, first, os.WSTOPPED)
    with monkeypatch.context() as undying:
        undying.setattr("subprocess.Popen.kill", lambda _process: None)
        told = [keeper.beat(EARLY_S + n * BEAT_S) for n in range(HANGS_AFTER + 2)]
        assert [text for text in told if text] == [
            "the guard process hung; starting another guard process"
        ]
        assert len(line.children()) == 2
        assert first in line.children()
    os.kill(first, signal.SIGKILL)
    beat_until(keeper, lambda: first not in line.children())
    monkeypatch.undo()
    keeper.end(stopped=False)
    line.hear(LAST_WORDS)


def test_guards_that_do_not_die_do_not_pile_up(line: Line, monkeypatch: pytest.MonkeyPatch) -> None:
    """Guards hang and cannot be killed. The driver starts no more guards after a limit.

    The limit is ``MOST_DYING``, which is 2 in this test.
    """
    monkeypatch.setattr("omnibot_driver.keeper.MOST_DYING", 2)
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    stopped: set[int] = set()
    with monkeypatch.context() as undying:
        undying.setattr("subprocess.Popen.kill", lambda _process: None)
        for second in range(4 * HANGS_AFTER):
            for pid in set(line.children()) - stopped:
                os.kill(pid, signal.SIGSTOP)
                os.waitid(os.P_PID, pid, os.WSTOPPED)
                stopped.add(pid)
            keeper.beat(EARLY_S + second)
    assert len(line.children()) == 2
    for pid in stopped:
        os.kill(pid, signal.SIGKILL)
    beat_until(keeper, lambda: stopped.isdisjoint(line.children()))
    keeper.end(stopped=False)
    line.hear(LAST_WORDS)


def test_a_guard_that_is_stopped_does_not_hold_up_the_end(line: Line) -> None:
    """The guard process is suspended when the driver ends, so it cannot read the end message.

    The driver waits only for a short time, then kills the guard.
    """
    keeper = Keeper([line.near], packed(LAST_WORDS), packed(LATCHED_WORDS))
    (pid,) = line.children()
    os.kill(pid, signal.SIGSTOP)
    keeper.end(stopped=True)


@pytest.mark.filterwarnings("ignore:subprocess .* is still running:ResourceWarning")
def test_a_guard_that_cannot_even_be_killed_does_not_hold_up_the_end(
    line: Line, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The guard cannot be killed when the driver ends. The driver waits only for a short time.

    In this test, the guard is suspended, and the driver's ``kill`` has no effect.
    """
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
