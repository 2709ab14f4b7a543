# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The threads that serve a port and a session, and the shutdown of the driver.

* The *reader* passes received bytes to the session, and delivers measurements at once.
* The *pacer* sleeps until a command, a timeout, a retry or a heartbeat is due.
* The *teller* delivers events from calls and from the pacer.

All threads and callers share one lock. Events are delivered in the order in which they occurred.
"""

import threading
import time
from collections.abc import Callable, Sequence
from typing import Final, TypeVar

from omnibot_driver.core.events import Event
from omnibot_driver.core.packets import Packet
from omnibot_driver.core.reporting.figures import LinkFigures, SessionFigures
from omnibot_driver.core.requests import OnExit
from omnibot_driver.core.session import Session
from omnibot_driver.kernel_counts import waited_s
from omnibot_driver.reader import Reader
from omnibot_driver.shared_session import SharedSession
from omnibot_driver.transports import Transport

JOIN_TIMEOUT_S: Final = 3.0
"""Longest wait for a thread to end, in s. The reader thread itself waits up to 2.5 s for the guard,
and then kills the guard."""
STANDS_WITHIN_S: Final = 0.5
"""Limit, in s, for the wait at shutdown for a proof that the robot is at rest. For a slow board,
the limit is larger."""
UNGUARDED_S: Final = 1.5
"""Longest wait at shutdown, in s, if no guard can repeat Stop after the shutdown. The driver waits
for a proof that the robot is at rest. For a slow board, the limit is larger."""
SILENCE_S: Final = 0.25
"""Longest wait at shutdown, in s, for the second proof that the robot is at rest. This proof shows
that the line did not damage the last Stop. For a slow board, the limit is larger."""
BOTH_PROOFS_S: Final = 2.4
"""Longest total time at shutdown, in s, for the two proofs that the robot is at rest. The guard
needs the remaining part of ``driver.LONGEST_END_S`` to repeat Stop."""

T = TypeVar("T")


class Link:
    """One session with one board. The link opens the board's ports, and opens lost ports again.

    * ``port``: name of the ports in messages to the user.
    * ``report``: receives a sentence when a port is missing, and None when all ports are open.
    * ``failed``: receives the exception that ended a thread, which is always a bug.

    All function arguments except ``opener`` and ``failed`` are called one at a time, on any thread,
    in the order of the events.
    """

    def __init__(
        self,
        session: Session,
        opener: Callable[[], Transport],
        port: str,
        *,
        guard: bool,
        reconnect_interval_s: float,
        deliver: Callable[[Sequence[Event]], None],
        report: Callable[[str | None], None],
        failed: Callable[[BaseException], None],
        refused: Callable[[str], None] = lambda _reason: None,
        on_read: Callable[[Packet], None] | None = None,
        on_write: Callable[[Packet], None] | None = None,
    ) -> None:
        self.unstopped = False
        """Whether ``close`` failed to send Stop although the robot may be moving."""
        self._name, self._failed = port, failed
        shared = self._shared = SharedSession(session, deliver, refused, on_write)
        self._session = session
        self._reader = Reader(
            shared,
            opener,
            guard=guard,
            reconnect_interval_s=reconnect_interval_s,
            deliver=deliver,
            report=report,
            on_read=on_read,
        )
        self._threads = [
            threading.Thread(target=self._guard, args=(work,), name=f"omnibot-{name}", daemon=True)
            for name, work in (
                ("reader", self._reader.serve),
                ("pacer", self._pace),
                ("teller", shared.outbox.serve),
            )
        ]

    def start(self) -> None:
        """Start the threads, which open the port and keep it open until ``close``."""
        for thread in self._threads:
            thread.start()

    def call(self, action: Callable[[Session, float], T]) -> T:
        """Call ``action`` with the session and the time in s, and return its result.

        ``SharedSession.call`` has the details.
        """
        return self._shared.call(action)

    def command(
        self,
        action: Callable[[Session, T, float], None],
        wish: T,
        sent_ns: Sequence[int],
        *,
        moves_base: bool = True,
    ) -> None:
        """Execute a motion command: call ``action`` with the session, the motion and the time.

        ``SharedSession.command`` describes the arguments.
        """
        self._shared.command(action, wish, sent_ns, moves_base=moves_base)

    @property
    def reconnect_interval_s(self) -> float:
        """Time in s from the loss of a port to the first attempt to open it again."""
        return self._reader.reconnect_interval_s

    @reconnect_interval_s.setter
    def reconnect_interval_s(self, interval_s: float) -> None:
        self._reader.reconnect_after(interval_s)

    @property
    def blocked(self) -> bool:
        """Whether the port did not accept the last packets. The reader then reopens the port."""
        return self._shared.blocked

    def figures(self) -> tuple[LinkFigures, SessionFigures]:
        """Return all counts and measurements of the link and the session, taken at one moment."""
        with self._shared.lock:
            link = LinkFigures(
                port=self._name,
                trouble=self._reader.trouble,
                opened=self._reader.opened,
                received_bytes=self._reader.received_bytes,
                sent_bytes=self._shared.sent_bytes,
                overruns=self._reader.overruns,
                waited_s=waited_s(self._threads[0].native_id or 0),
            )
            return link, self._session.figures(time.monotonic())

    def close(self, on_exit: OnExit) -> bool:
        """Stop the robot, end the threads and close the port. A second call is allowed.

        A lost port is opened once more to send Stop. Return True if this call ended the threads and
        Stop was sent.
        """
        with self._shared.lock:
            if ends := not self._shared.leaving:
                self._shared.leaving = True
                self._shared.on_exit = on_exit
                self._stop_for_good()
                self._shared.write(self._session.shutdown.sequence(on_exit, time.monotonic()))
                if self._shared.port is not None:
                    told = self._shared.write_error is None and not self._shared.port.missing
                    self._shared.told = told
                    self._shared.stood = told and self._session.shutdown.stands
                    self._shared.port.interrupt()
                    self._shared.port = None  # nothing may be sent after the shutdown sequence
            self._shared.closing.set()
            self._shared.changed.notify_all()
        *serving, teller = self._threads
        self._join(serving)
        self._shared.outbox.close()
        self._join([teller])
        # The reader may have opened a lost port again and sent Stop. The lock is not taken here,
        # because a reader that hangs holds it.
        self.unstopped = not self._shared.told and self._session.shutdown.owed
        return ends and self._shared.told and not any(thread.is_alive() for thread in serving)

    @staticmethod
    def _join(threads: Sequence[threading.Thread]) -> None:
        for thread in threads:
            if thread.is_alive():
                thread.join(JOIN_TIMEOUT_S)

    @property
    def stands(self) -> bool:
        """Whether ``close`` sent Stop, and measurements proved that the robot is at rest."""
        return self._shared.stood

    def _stop_for_good(self) -> None:
        """Stop the robot and wait until it is at rest. The caller holds the lock.

        The wait releases the lock, so that the pacer thread can repeat Stop.
        """
        self._session.shutdown.begin(now := time.monotonic())
        end = now + BOTH_PROOFS_S
        self._shared.settle()
        alone = (
            self._shared.port is not None
            and self._shared.keeper is None
            and not self._shared.port.ends_with_us
        )
        proof_s = self._session.shutdown.proof_takes_s + self._session.board.traits.stops_within_s
        wait_s = max(UNGUARDED_S if alone else STANDS_WITHIN_S, proof_s)
        self._await_standstill(min(end, now + wait_s))
        if self._session.shutdown.stands and self._session.shutdown.fall_silent(
            now := time.monotonic()
        ):
            self._await_standstill(min(end, now + max(SILENCE_S, proof_s)))

    def _await_standstill(self, until: float) -> None:
        while (
            self._shared.port is not None
            and self._shared.write_error is None
            and not self._session.shutdown.stands
        ):
            if (left_s := until - time.monotonic()) <= 0.0:
                break
            self._shared.changed.wait(left_s)

    def _guard(self, work: Callable[[], None]) -> None:
        try:
            work()
        except BaseException as error:
            self._failed(error)

    def _pace(self) -> None:
        shared = self._shared
        while True:
            with shared.lock:
                if shared.closing.is_set():
                    return
                shared.pace()
            shared.outbox.hand_over()
