# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The work of the reader thread: it reads the port, and passes the bytes to the session.

The reader delivers measurements itself, so that nothing delays them. It must stop the robot before
it releases a port.
"""

import math
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from functools import partial
from typing import Final

from omnibot_driver.core.errors import LinkError
from omnibot_driver.core.events import Event, Notice
from omnibot_driver.core.packets import Packet
from omnibot_driver.keeper import WITHOUT_GUARD, Keeper
from omnibot_driver.outbox import Delivery
from omnibot_driver.shared_session import SharedSession
from omnibot_driver.transports import LinesChanged, Transport

COUNT_EVERY_S: Final = 1.0
"""Interval, in s, at which the reader reads the kernel's count of lost bytes."""
BACK_OFF: Final = 1.5
LONGEST_WAIT_S: Final = 2.0


class Reader:
    """The work of the reader thread, which runs ``serve``, and its counts.

    * ``trouble``: why a port of the board is not open; empty if all are open.
    * ``opened``: how often the port was opened.
    * ``overruns``: how often the kernel has lost bytes since the last opening; None if unknown.
    """

    def __init__(
        self,
        shared: SharedSession,
        opener: Callable[[], Transport],
        *,
        guard: bool,
        reconnect_interval_s: float,
        deliver: Callable[[Sequence[Event]], None],
        report: Callable[[str | None], None],
        on_read: Callable[[Packet], None] | None,
    ) -> None:
        self._shared, self._open, self._has_guard = shared, opener, guard
        self._session, self._outbox, self._lock = shared.session, shared.outbox, shared.lock
        self._closing = shared.closing
        self._deliver, self._report, self._on_read = deliver, report, on_read
        self.reconnect_interval_s = self._wait_s = reconnect_interval_s
        self.trouble = ""
        self.opened = self.received_bytes = 0
        self.overruns: int | None = None
        self._earlier_overruns = 0
        self._count_at = -math.inf
        self._unguarded_told = False

    def serve(self) -> None:
        """Open and read the port until the link closes. Open it again whenever it is lost."""
        # A lost port is opened once more at the end, to stop a robot that was driving.
        while not (leaving := self._closing.is_set()) or self.opened:
            try:
                with closing(self._open()) as port:
                    comes_back = False
                    try:
                        with self._lock:
                            self._earlier_overruns += self.overruns or 0
                            self.overruns = None
                        self._attach(port)
                        self._read(port)
                    except LinkError:
                        comes_back = True
                        raise
                    finally:
                        self._detach(port, comes_back=comes_back)
                return
            except LinkError as error:
                if leaving:
                    return
                self.trouble = str(error)
                self._tell(partial(self._report, self.trouble))
                self._await_next_attempt()

    def reconnect_after(self, interval_s: float) -> None:
        """Change ``reconnect_interval_s``. A new interval also applies to the wait in progress."""
        with self._lock:
            if interval_s != self.reconnect_interval_s:
                self.reconnect_interval_s = self._wait_s = interval_s
                self._shared.changed.notify_all()

    def _await_next_attempt(self) -> None:
        began = time.monotonic()
        with self._lock:
            while not self._closing.is_set():
                if (left_s := began + self._wait_s - time.monotonic()) <= 0.0:
                    break
                self._shared.changed.wait(left_s)
            longest_s = max(LONGEST_WAIT_S, self.reconnect_interval_s)
            self._wait_s = min(BACK_OFF * self._wait_s, longest_s)

    def _attach(self, port: Transport) -> None:
        names = self._session.board.traits.channels
        missing = {
            f"the port '{names[number]}' is missing": why for number, why in port.missing.items()
        }
        self.trouble = "; ".join(f"{which}: {why}" for which, why in missing.items())
        self._tell(partial(self._report, self.trouble or None))
        keeper, notices = self._guarded(port)
        with self._lock:
            self._shared.port, self._shared.write_error, self._shared.keeper = port, None, keeper
            self.opened += 1
            self._count_at = -math.inf
            self._session.opened(time.monotonic(), missing="; ".join(missing))
            if notices:
                self._outbox.put(partial(self._deliver, notices))
            self._shared.settle()
        self._outbox.deliver()

    def _attach_anew(self, port: Transport) -> None:
        """Begin a new connection, because one of the board's lines was lost or opened again."""
        with self._lock:
            self._shared.write(self._session.shutdown.broken_off())
            self._session.closed(now := time.monotonic())
            self._session.opened(now, missing="a port of the board was connected or lost")
            keeper = self._shared.keeper
        try:
            self._attach(port)
        finally:
            if keeper is not None:  # the old guard, which runs until the new one has started
                keeper.end(stopped=True)

    def _guarded(self, port: Transport) -> tuple[Keeper | None, list[Notice]]:
        if not self._has_guard or port.ends_with_us:
            return None, []
        if port.descriptors is not None:
            return Keeper(port.descriptors, *self._session.board.last_words()), []
        told, self._unguarded_told = self._unguarded_told, True
        text = f"this kind of port cannot be shared with a guard process: {WITHOUT_GUARD}"
        return None, [] if told else [Notice(text)]

    def _read(self, port: Transport) -> None:
        while not self._closing.is_set():
            try:
                packet = channel, data = port.read()
            except LinesChanged:
                self._attach_anew(port)
                continue
            if data and self._on_read is not None:
                self._tell(partial(self._on_read, packet))
            with self._lock:
                if self._shared.write_error is not None:
                    raise self._shared.write_error
                if not data:
                    continue
                now = time.monotonic()
                if self._shared.heed_stall():  # before these bytes, which waited in the stall
                    self._shared.settle()
                self._wait_s = self.reconnect_interval_s
                self.received_bytes += len(data)
                self._count(port, now)
                measured = self._session.inbound.hear(data, now, channel)
                if not measured:
                    self._process(now)
                elif not (claimed := self._outbox.claim()):
                    self._outbox.put(partial(self._deliver, measured))
            if measured:
                if claimed:
                    try:
                        self._deliver(measured)
                    finally:
                        self._outbox.release()
                else:
                    self._outbox.deliver()
                with self._lock:
                    self._process(now)
            self._outbox.deliver()

    def _process(self, now: float) -> None:
        """Let the session process the bytes that it has decoded with ``hear``.

        The processing can result in a command to the board. The caller holds the lock.
        """
        if self._session.inbound.process(now):
            self._shared.settle()
        else:
            self._shared.tell_guard()

    def _count(self, port: Transport, now: float) -> None:
        """Read the kernel's count of lost bytes once a second. The caller holds the lock."""
        if now < self._count_at:
            return
        self._count_at = now + COUNT_EVERY_S
        self.overruns = port.overruns
        if self.overruns:
            self._session.overran(self._earlier_overruns + self.overruns)

    def _detach(self, port: Transport, *, comes_back: bool) -> None:
        """Stop the robot, and then give up the port.

        ``comes_back``: whether the reader will try to open the port again.
        """
        with self._lock:
            if self._shared.write_error is None:
                self._shared.write(
                    self._session.shutdown.sequence(self._shared.on_exit, time.monotonic())
                )
                if self._closing.is_set() and self._shared.port is not None:
                    told = self._shared.write_error is None and not port.missing
                    self._shared.told = told and self._session.shutdown.owed
            else:  # write Stop directly after the bytes that can no longer be discarded
                port.write_if_room(self._session.shutdown.broken_off())
            # One of several lines may still be open. It then needs a stop.
            lines = len(port.descriptors or ())
            written = self._closing.is_set() and self._shared.write_error is None
            stopped = self._shared.stood if self._closing.is_set() else comes_back and lines < 2
            keeper, self._shared.port, self._shared.keeper = self._shared.keeper, None, None
            self._session.closed(time.monotonic())
            self._shared.settle()
        if keeper is not None:
            keeper.end(stopped=stopped, written=written)
        self._outbox.deliver()

    def _tell(self, delivery: Delivery) -> None:
        """Deliver an event that occurred while the reader thread did not hold the lock."""
        self._outbox.put(delivery)
        self._outbox.deliver()
