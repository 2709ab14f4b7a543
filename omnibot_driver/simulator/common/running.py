# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A simulated board in real time: the thread that lets a tick pass every 10 ms.

Knows the clock and the board's `receive` and `step`. Must not know what carries the bytes, nor
what they mean.
"""

import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING

from omnibot_driver.simulator.common.faults import FaultyLine, LineFaults

if TYPE_CHECKING:
    from omnibot_driver.simulator.omnibot.firmware import SimulatedBoard

TICK_S = 0.01

UNREAD_LIMIT = 4095
"""Bytes that a Linux terminal holds for a reader who does not read; later ones are lost."""

LONGEST_CATCH_UP_S = 1.0
"""After a longer standstill of the machine the schedule starts afresh."""

_JOIN_S = 5.0


class RunningBoard(ABC):
    """Runs a board at 100 Hz between `start` and `stop`; `line` is what its bytes go through first.

    `dropped` counts bytes that nobody read in time. From other threads touch `board` under `lock`
    only. `stop`, `check` and `wait_for` raise RuntimeError when the board's thread died.
    """

    def __init__(self, board: "SimulatedBoard", line: FaultyLine | None = None) -> None:
        self.board = board
        self.line = line or FaultyLine(LineFaults())
        self.dropped = 0
        self.lock = threading.RLock()
        self._ticked = threading.Condition(self.lock)
        self._stopping = threading.Event()
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="simulated board")

    @abstractmethod
    def _receive(self, timeout_s: float) -> bytes:
        """What the driver has sent; waits for it so long at the most."""

    @abstractmethod
    def _send(self, data: bytes) -> int:
        """Give bytes to the driver; returns how many found room."""

    def start(self) -> None:
        """Let time pass."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread."""
        self._stopping.set()
        self._thread.join(_JOIN_S)
        if self._thread.is_alive():
            raise RuntimeError(f"the simulated board's thread did not end within {_JOIN_S} s")
        self.check()

    def check(self) -> None:
        """Raise RuntimeError, with the cause attached, if the board's thread has died."""
        if self._error is not None:
            raise RuntimeError("the simulated board's thread died") from self._error

    def wait_for(self, predicate: Callable[["SimulatedBoard"], bool], timeout_s: float) -> bool:
        """Ask the predicate under the lock after each tick; return whether it came to hold."""
        with self._ticked:
            held = self._ticked.wait_for(
                lambda: self._error is not None or predicate(self.board), timeout_s
            )
            self.check()
            return held

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
            if data := self._receive(max(0.0, remaining_s)):
                with self.lock:
                    self.board.receive(data, time.monotonic())
            ticks, due_s = self._due(due_s)
            if ticks:
                with self._ticked:
                    data = b"".join(self.line.carry(self.board.step()) for _ in range(ticks))
                    self.dropped += len(data) - self._send(data)
                    self._ticked.notify_all()

    @staticmethod
    def _due(due_s: float) -> tuple[int, float]:
        """Ticks to be made up for, and when the next is due.

        What is late comes together, as it does over a line that runs on while a machine is busy.
        """
        late_s = time.monotonic() - due_s
        ticks = 0 if late_s < 0 else 1 + int(late_s / TICK_S)
        return ticks, due_s + ticks * TICK_S
