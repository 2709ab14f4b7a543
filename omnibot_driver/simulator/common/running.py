# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A simulated board in real time: the thread that advances it tick by tick.

This module must not know what packets mean or how they are transported.
"""

import threading
import time
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from itertools import groupby
from operator import itemgetter
from typing import Generic

from omnibot_driver.simulator.common.board import Packet
from omnibot_driver.simulator.common.wired import B, Line, WiredBoard

UNREAD_LIMIT = 4095
"""Number of unread bytes that a Linux terminal holds; further bytes are lost."""

LONGEST_CATCH_UP_S = 1.0
"""Longest delay in s that the thread makes up for by running the missed ticks. After a longer
delay, it skips them."""

_JOIN_S = 5.0


class RunningBoard(ABC, Generic[B]):
    """Runs a board in a thread from ``start`` to ``stop``; its packets pass through ``lines``.

    * ``dropped``: number of bytes lost at the port: not read in time, or the driver's UDP address
      is unknown.
    * ``board``: the simulated board, which other threads must use under ``lock``.

    ``stop``, ``check`` and ``wait_for`` raise RuntimeError if the thread has died.
    """

    def __init__(self, board: B, lines: Sequence[Line] = ()) -> None:
        self.board = board
        self._wired = WiredBoard(board, lines)
        self.dropped = 0
        self.lock = threading.RLock()
        self._ticked = threading.Condition(self.lock)
        self._stopping = threading.Event()
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="simulated board")

    @abstractmethod
    def _receive(self, timeout_s: float) -> Iterable[Packet]:
        """Return the packets from the driver; wait at most ``timeout_s`` for the first."""

    @abstractmethod
    def _send(self, channel: int, data: bytes) -> int:
        """Send bytes, or one datagram, to the driver; return how many bytes were accepted."""

    @property
    def facts(self) -> dict[str, object]:
        """``board.facts``, the number of dropped bytes, and the number of faults of each kind.

        The caller must hold ``lock``.
        """
        met = sum((line.counts for line in self._wired.lines), Counter())
        names = dict.fromkeys(name for line in self._wired.lines for name in line.counts)
        return {
            **self.board.facts,
            "dropped": self.dropped,
            **{name: met[name] for name in names},
        }

    def start(self) -> None:
        """Start the thread, and with it the board's time."""
        self._thread.start()

    def stop(self) -> None:
        """Stop the thread, and wait until it ends.

        Raises RuntimeError if the thread has died, or does not end within 5 s.
        """
        self._stopping.set()
        self._thread.join(_JOIN_S)
        if self._thread.is_alive():
            raise RuntimeError(f"the simulated board's thread did not end within {_JOIN_S} s")
        self.check()

    def check(self) -> None:
        """Raise RuntimeError, with the cause attached, if the board's thread has died."""
        if self._error is not None:
            raise RuntimeError("the simulated board's thread died") from self._error

    def wait_for(self, predicate: Callable[[B], bool], timeout_s: float) -> bool:
        """Wait until ``predicate`` is true; return whether this happened within ``timeout_s``.

        The predicate is evaluated at once and then after new ticks, while ``lock`` is held.
        """
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
        due_s = time.monotonic() + self.board.tick_s
        while not self._stopping.is_set():
            remaining_s = due_s - time.monotonic()
            if remaining_s < -LONGEST_CATCH_UP_S:
                due_s -= remaining_s
            self._collect(max(0.0, remaining_s))
            ticks, due_s = self._due(due_s)
            if ticks > 1:  # this thread was late: receive waiting input before these ticks
                self._collect(0.0)
            if ticks:
                with self._ticked:
                    self._let_pass(ticks)
                    self._ticked.notify_all()

    def _collect(self, timeout_s: float) -> None:
        for channel, data in self._receive(timeout_s):
            with self.lock:
                self._wired.receive(data, time.monotonic(), channel)

    def _due(self, due_s: float) -> tuple[int, float]:
        """Return the number of overdue ticks, and the time in s of the next tick.

        The caller must run the overdue ticks at once.
        """
        late_s = time.monotonic() - due_s
        ticks = 0 if late_s < 0 else 1 + int(late_s / self.board.tick_s)
        return ticks, due_s + ticks * self.board.tick_s

    def _let_pass(self, ticks: int) -> None:
        packets = [packet for _ in range(ticks) for packet in self._wired.advance()]
        for channel, of_channel in groupby(packets, itemgetter(0)):
            parts = [data for _, data in of_channel]
            datagrams = self.board.channels[channel].datagrams
            for data in parts if datagrams else [b"".join(parts)]:
                self.dropped += len(data) - self._send(channel, data)
