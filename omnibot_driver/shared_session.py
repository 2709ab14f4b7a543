# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""One session and its open port, which several threads share under one lock.

Call ``settle`` after each input to the session. This module starts no thread and opens no port.
"""

import math
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Final, TypeVar

from omnibot_driver.core.errors import CommandRefused, LinkError
from omnibot_driver.core.events import Event, Notice
from omnibot_driver.core.packets import Packet, Packets
from omnibot_driver.core.requests import OnExit
from omnibot_driver.core.session import Session
from omnibot_driver.keeper import BEAT_S, Keeper
from omnibot_driver.outbox import Outbox
from omnibot_driver.stall_detector import StallDetector, boot_time_s
from omnibot_driver.transports import Transport

WAITED: Final = "motion command refused: it waited while the driver was stalled; send it again"

T = TypeVar("T")


class SharedSession:
    """A session, its open port, and the lock that protects both.

    Only ``call``, ``command`` and ``blocked`` may be used without ``lock``.

    * ``changed``: condition variable of this lock, for the pacer, the shutdown, and a reader that
      has no port.
    * ``keeper``: the object that runs the guard process; None without a guard.
    * ``write_error``: the error after which nothing more is written, or None.
    """

    def __init__(
        self,
        session: Session,
        deliver: Callable[[Sequence[Event]], None],
        refused: Callable[[str], None],
        on_write: Callable[[Packet], None] | None,
    ) -> None:
        self.session = session
        self.lock = threading.Lock()
        self.changed = threading.Condition(self.lock)
        self.outbox = Outbox()
        self.port: Transport | None = None
        self.write_error: LinkError | None = None
        self.keeper: Keeper | None = None
        self.sent_bytes = 0
        self.leaving = False
        """Whether the link is about to end."""
        self.on_exit: OnExit = "stop"
        """What the driver sends to the board when the link ends, in addition to Stop."""
        self.told = False
        """Whether the link wrote its last Stop to every line. If the port was reopened for this
        Stop, True only if the proof of a stop was still missing (``Shutdown.owed``)."""
        self.stood = False
        """Whether the robot was known to stand still when the link ended. Stop was written to every
        line, and measurements showed the robot at rest after the last motion command."""
        self.closing = threading.Event()
        """Set when all threads must end."""
        self._deliver, self._refused, self._on_write = deliver, refused, on_write
        self._stall_detector = StallDetector()
        self._pacing_until = self._beat_at = -math.inf

    def call(self, action: Callable[[Session, float], T]) -> T:
        """Call ``action`` with the session and the time in s, and return its result.

        Packets are written before ``call`` returns. Another thread delivers the events.
        """
        try:
            with self.lock:
                now = time.monotonic()
                self.heed_stall()
                try:
                    return action(self.session, now)
                finally:
                    self.settle()
        finally:
            self.outbox.hand_over()

    def command(
        self,
        action: Callable[[Session, T, float], None],
        wish: T,
        sent_ns: Sequence[int],
        *,
        moves_base: bool = True,
    ) -> None:
        """Call ``action`` with the session, the commanded motion ``wish``, and the time in s.

        * ``sent_ns``: possible times of sending, as times of day in ns: two if the sender's clock
          is uncertain, none for a command to stop, otherwise one.
        * ``moves_base``: whether the command moves the base, so that the motion interlock records a
          refusal.

        Raises CommandRefused if ``action`` does, or if the command may have been sent before or
        during a recent stall. The constructor's function ``refused`` receives the reason, unless
        the queue of events is full.
        """
        try:
            with self.lock:
                now = time.monotonic()
                try:
                    boot_s = boot_time_s()
                    outlived = self._stall_detector.outlived_by
                    # At the shutdown the pacer thread has ended, which is not a stall.
                    if not (
                        self.closing.is_set() or all(outlived(at_ns, boot_s) for at_ns in sent_ns)
                    ):
                        self._heed_stall(boot_s)
                        raise CommandRefused(WAITED)
                    action(self.session, wish, now)
                except CommandRefused as error:
                    if moves_base:
                        self.session.interlocks.refused(now)
                    if not self.outbox.full:
                        self.outbox.put(partial(self._refused, str(error)))
                    raise
                finally:
                    self.settle()
        finally:
            self.outbox.hand_over()

    @property
    def blocked(self) -> bool:
        """Whether the port did not accept the last packets. The reader then reopens the port."""
        with self.lock:
            return self.write_error is not None

    def settle(self) -> None:
        """Write due packets, queue events, and wake the pacer thread if it would sleep too long."""
        packets = self.session.take_output(time.monotonic())
        self.tell_guard()
        if packets:
            self.write(packets)
        if self.session.wake_at < self._pacing_until or self.leaving:
            self.changed.notify_all()
        if events := self.session.take_events():
            self.outbox.put(partial(self._deliver, events))

    def write(self, packets: Packets) -> None:
        """Write packets to the open port. If that fails, the reader opens the port again."""
        if not packets or self.port is None or self.write_error is not None:
            return
        try:
            self.port.write(packets)
            self.sent_bytes += sum(len(data) for _, data in packets)
        except LinkError as error:
            self.write_error = error
            self.port.interrupt()
        else:
            if self._on_write is not None:
                for packet in packets:
                    self.outbox.put(partial(self._on_write, packet))

    def tell_guard(self) -> None:
        """Send the guard process the board's stop commands if they have changed."""
        if (keeper := self.keeper) is None:
            return
        if (words := self.session.board.last_words()) != keeper.last_words:
            keeper.change(*words)

    def pace(self) -> None:
        """Run one step of the pacer thread: do what is due, or sleep until something is due."""
        now = time.monotonic()
        self._pacing_until = min(self.session.wake_at, self._beat_at)
        if now < self._pacing_until:
            self.changed.wait(self._pacing_until - now)
            return
        self._beat(now)
        if now >= self.session.wake_at:
            self.session.tick(now)
            self.settle()

    def heed_stall(self) -> bool:
        """Stop the robot if this process was stalled. Return True only if this call stopped it."""
        return self._heed_stall(boot_time_s())

    def _heed_stall(self, boot_s: float) -> bool:
        length_s = 0.0 if self.closing.is_set() else self._stall_detector.begun(boot_s)
        if length_s:  # the caller may have read the steady clock before the stall
            self.session.stood_still(length_s, time.monotonic())
        return length_s > 0.0

    def _beat(self, now: float) -> None:
        """Record that the pacer thread runs, and send the guard a heartbeat if one is due.

        A pause of 0.4 s between two calls counts as a stall.
        """
        boot_s = boot_time_s()  # read once: a stall may come between two readings
        self._heed_stall(boot_s)
        self._stall_detector.passed(boot_s, time.time_ns())
        if now < self._beat_at:
            return
        self._beat_at = now + BEAT_S
        if self.keeper is None:
            return
        if trouble := self.keeper.beat(now, latched=self.session.estop_active):
            self.outbox.put(partial(self._deliver, [Notice(trouble)]))
