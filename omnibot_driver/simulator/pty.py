"""A simulated board in real time behind a pseudo-terminal: the only place with threads and ports.

Knows descriptors, the clock and the board's `receive` and `step`. Must not know what bytes mean.
"""

import array
import fcntl
import os
import select
import termios
import threading
import time
import tty
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

from omnibot_driver.simulator.faults import FaultyLine, LineFaults
from omnibot_driver.simulator.firmware import SimulatedBoard
from omnibot_driver.simulator.motors import TICK_S

UNREAD_LIMIT = 4095
"""Bytes that a Linux terminal holds for a reader who does not read."""

LONGEST_CATCH_UP_S = 1.0
"""After a longer standstill of the machine the schedule starts afresh."""

_JOIN_S = 5.0


class PtyBoard:
    """Context manager that runs a board at 100 Hz on a new pseudo-terminal, found at `path`.

    The terminal outlives the programs that open it. Bytes that nobody reads are lost like those of
    a UART once the kernel's buffer is full; `dropped` counts them. `link` names a symbolic link to
    be made for the terminal and removed on exit. `line` is what the board's bytes go through first.

    From other threads touch `board` under `lock` only. Raises FileExistsError when `link` is taken
    by anything but a dead link or a link to a pseudo-terminal, and RuntimeError on exit (and from
    `wait_for`) when the board's thread died.
    """

    def __init__(
        self, board: SimulatedBoard, link: str | None = None, line: FaultyLine | None = None
    ) -> None:
        self.board = board
        self.line = line or FaultyLine(LineFaults())
        self.path = ""
        self.dropped = 0
        self.lock = threading.RLock()
        self._ticked = threading.Condition(self.lock)
        self._link = None if link is None else Path(link)
        self._stopping = threading.Event()
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="simulated board")

    def __enter__(self) -> Self:
        self._master, self._slave = os.openpty()
        try:
            tty.setraw(self._slave)
            os.set_blocking(self._master, False)
            self.path = os.ttyname(self._slave)
            if self._link is not None:
                _make_link(self._link, self.path)
        except BaseException:
            self._close()
            raise
        self._thread.start()
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._stopping.set()
        self._thread.join(_JOIN_S)
        if self._link is not None and _leads_to(self._link, self.path):
            self._link.unlink()
        if self._thread.is_alive():
            raise RuntimeError(f"the simulated board's thread did not end within {_JOIN_S} s")
        self._close()
        self.check()

    def check(self) -> None:
        """Raise RuntimeError, with the cause attached, if the board's thread has died."""
        if self._error is not None:
            raise RuntimeError("the simulated board's thread died") from self._error

    def wait_for(self, predicate: Callable[[SimulatedBoard], bool], timeout_s: float) -> bool:
        """Ask the predicate under the lock after each tick; return whether it came to hold."""
        with self._ticked:
            held = self._ticked.wait_for(
                lambda: self._error is not None or predicate(self.board), timeout_s
            )
            self.check()
            return held

    def _close(self) -> None:
        os.close(self._master)
        os.close(self._slave)

    def _run(self) -> None:
        try:
            self._keep_time()
        except BaseException as error:
            with self._ticked:
                self._error = error
                self._ticked.notify_all()

    def _keep_time(self) -> None:
        due_s = time.monotonic() + TICK_S
        while not self._stopping.is_set():
            remaining_s = due_s - time.monotonic()
            if remaining_s < -LONGEST_CATCH_UP_S:
                due_s -= remaining_s
            readable, _, _ = select.select([self._master], [], [], max(0.0, remaining_s))
            if readable:
                data = os.read(self._master, 4096)
                with self.lock:
                    self.board.receive(data)
            if time.monotonic() >= due_s:
                due_s += TICK_S
                with self._ticked:
                    self._send(self.line.carry(self.board.step()))
                    self._ticked.notify_all()

    def _send(self, data: bytes) -> None:
        unread = array.array("i", [0])
        fcntl.ioctl(self._slave, termios.FIONREAD, unread)
        room = max(0, UNREAD_LIMIT - unread[0])
        try:
            written = os.write(self._master, data[:room]) if room and data else 0
        except BlockingIOError:
            written = 0
        self.dropped += len(data) - written


def _make_link(link: Path, target: str) -> None:
    if link.is_symlink():
        if link.exists() and not os.path.realpath(link).startswith("/dev/pts/"):
            raise FileExistsError(
                f"{link} already leads to {os.path.realpath(link)}, which is no pseudo-terminal; "
                "choose another name for the simulator's link or remove it first"
            )
        link.unlink()
    elif link.exists():
        raise FileExistsError(
            f"{link} exists and is no symbolic link; choose another name for the simulator's link "
            "or remove it first"
        )
    link.symlink_to(target)


def _leads_to(link: Path, target: str) -> bool:
    return link.is_symlink() and os.readlink(link) == target
