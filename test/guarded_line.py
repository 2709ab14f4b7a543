# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Helpers for tests of the guard, the process that stops the robot if the driver cannot.

The helpers are a pseudo-terminal that replaces the board, and functions that act as the driver.
"""

import contextlib
import os
import select
import signal
import time
import tty
from collections.abc import Callable
from pathlib import Path

from terminal import fill

from omnibot_driver.keeper import Keeper

PATIENCE_S = 60.0


LAST_WORDS = b"these are my last words"


LATCHED_WORDS = b"and these under the e-stop"


EARLY_S = -1000.0
"""Time of a simulated heartbeat, in s. It is negative, so it is earlier than any time of the real
clock, which begins near 0 at boot."""


class Line:
    """A pseudo-terminal that replaces the serial line. ``near`` is the end at the driver."""

    def __init__(self) -> None:
        self._far, self.near = os.openpty()
        tty.setraw(self.near)
        os.set_blocking(self.near, False)
        self.heard = b""
        self._others = children()

    def children(self) -> list[int]:
        """Return the processes that were started since this line was made, zombies included."""
        return [pid for pid in children() if pid not in self._others]

    def hear(self, words: bytes) -> bytes:
        """Read until ``words`` has arrived, and return everything received so far."""
        end = time.monotonic() + PATIENCE_S
        while words not in self.heard:
            assert select.select([self._far], [], [], end - time.monotonic())[0], self.heard
            self.heard += os.read(self._far, 4096)
        return self.heard

    def fill(self) -> None:
        fill(self.near)

    def hang_up(self) -> None:
        os.close(self._far)
        self._far = -1

    def close(self) -> None:
        os.close(self.near)
        if self._far >= 0:
            os.close(self._far)


def children() -> list[int]:
    """Return the ids of the child processes of this process, zombies included."""
    found = []
    for directory in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            after_name = (directory / "stat").read_text().rpartition(")")[2].split()
            if int(after_name[1]) == os.getpid():
                found.append(int(directory.name))
    return found


def started(pid: int) -> None:
    """Wait until the program of the guard process runs: it then ignores SIGTERM."""
    end = time.monotonic() + PATIENCE_S
    bit = 1 << (signal.SIGTERM - 1)
    while not int(status_of(pid, "SigIgn"), 16) & bit:
        assert time.monotonic() < end
        time.sleep(0.005)  # no event reports that a process ignores a signal


def status_of(pid: int, field: str) -> str:
    text = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    return text.partition(f"{field}:")[2].split()[0]


def alive(keeper: Keeper, seconds: float) -> float:
    """Send heartbeats for ``seconds`` at the driver's rate.

    Return the longest time between two heartbeats, in s.
    """
    begun_s = beaten_s = time.monotonic()
    longest_s = 0.0
    while (now := time.monotonic()) < begun_s + seconds:
        keeper.beat(now)
        time.sleep(0.05)  # this simulates the driver's own pace
        longest_s, beaten_s = max(longest_s, time.monotonic() - beaten_s), now
    return longest_s


def beat_until(keeper: Keeper, predicate: Callable[[], bool]) -> str:
    """Send heartbeats at the driver's rate until ``predicate`` holds. Return the log messages."""
    told, end = "", time.monotonic() + PATIENCE_S
    while not predicate():
        assert time.monotonic() < end
        told += keeper.beat(time.monotonic())
        time.sleep(0.05)  # this simulates the driver's own pace
    return told


def replaced(line: Line, guard: int) -> bool:
    """Return whether the guard with the process id ``guard`` is gone and another guard runs."""
    found = line.children()
    return bool(found) and guard not in found
