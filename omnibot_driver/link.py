# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The threads that serve a port and a session: the only module that knows threads and the clock.

The *reader* opens the port, waits for bytes, hands them to the session and delivers what comes of
them at once, on its own thread: no timer and no other thread stand between the wire and the
listener. The *pacer* sleeps until something is due (a repeated command, a timeout, a retry), so the
watchdog depends on nobody's executor. It is also the one whose heartbeat the guard hears. They and
every caller go through one lock. What the pacer and callers have to tell is delivered by the
*teller*, so a slow listener delays neither; all of it leaves in the order of that lock.
"""

import math
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from functools import partial
from typing import Final, TypeVar

from omnibot_driver.core.errors import CommandRefused, LinkError
from omnibot_driver.core.events import Event, Notice
from omnibot_driver.core.packets import Packet, Packets
from omnibot_driver.core.reporting.figures import LinkFigures, SessionFigures
from omnibot_driver.core.requests import OnExit
from omnibot_driver.core.session import Session
from omnibot_driver.keeper import BEAT_S, WITHOUT_GUARD, Keeper
from omnibot_driver.kernel_counts import waited_s
from omnibot_driver.outbox import Delivery, Outbox
from omnibot_driver.stall_detector import StallDetector, boot_time_s
from omnibot_driver.transports import LinesChanged, Transport

JOIN_TIMEOUT_S: Final = 3.0
"""Longer than a guard takes to repeat Stop."""
STANDS_WITHIN_S: Final = 0.5
"""So long an end waits until the robot is seen to stand, longer where a proof takes longer; then
the guard repeats Stop."""
UNGUARDED_S: Final = 1.5
"""So long where no guard does."""
SILENCE_S: Final = 0.25
"""So long it then waits, without a word, to see that the last Stop was no damaged one."""
COUNT_EVERY_S: Final = 1.0
"""The kernel is asked what it lost."""
BACK_OFF: Final = 1.5
LONGEST_WAIT_S: Final = 2.0
WAITED: Final = "motion command refused: it waited while the driver stood still; send it again"

T = TypeVar("T")


class Link:
    """One session on one port, which is opened again whenever it is lost.

    ``opener`` opens the transport, whose name for the user is ``port``. ``guard``: whether a
    process of its own is to say the board's last words when this one cannot.
    ``deliver`` gets the session's events; ``refused`` the reason why a command was not obeyed;
    ``report`` a sentence about the port whenever it, or one of its lines, cannot be had or is lost,
    and None when all of it is open; ``on_read`` and ``on_write`` each packet that was read and
    written. They are called one at a time, in the order in which it happened, on the reader's
    thread or another.
    ``failed`` gets the exception that ended a thread, which nothing but a defect can do.
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
        self._session = session
        self._name = port
        self._trouble = ""
        self._opened = self._received = self._sent = 0
        self._overruns: int | None = None
        self._count_at = -math.inf
        self._open = opener
        self._has_guard = guard
        self.reconnect_interval_s = self._wait_s = reconnect_interval_s
        self._deliver, self._report, self._failed = deliver, report, failed
        self._refused = refused
        self._outbox = Outbox()
        self._on_read, self._on_write = on_read, on_write
        self._lock = threading.Lock()
        self._changed = threading.Condition(self._lock)
        self._closing = threading.Event()
        self._leaving = self._stands = False
        self._on_exit: OnExit = "stop"
        self._port: Transport | None = None
        self._write_error: LinkError | None = None
        self._keeper: Keeper | None = None
        self._unguarded_told = False
        self._standstill = StallDetector()
        self._pacing_until = self._beat_at = -math.inf
        self._threads = [
            threading.Thread(target=self._guard, args=(work,), name=f"omnibot-{name}", daemon=True)
            for name, work in (
                ("reader", self._serve),
                ("pacer", self._pace),
                ("teller", self._outbox.serve),
            )
        ]

    def start(self) -> None:
        """Begin to open the port; goes on until ``close``."""
        for thread in self._threads:
            thread.start()

    def call(self, action: Callable[[Session, float], T]) -> T:
        """Do something with the session; what it has to say is on the wire before this returns.

        What comes of it is delivered by another thread.
        """
        try:
            with self._lock:
                now = time.monotonic()
                self._heed_standstill(boot_time_s())
                try:
                    return action(self._session, now)
                finally:
                    self._settle()
        finally:
            self._outbox.hand_over()

    @property
    def blocked(self) -> bool:
        """What was said last was not taken, and the port is opened anew.

        It may be gone by now: the reader is woken by what the caller finds here.
        """
        with self._changed:
            return self._write_error is not None

    def command(
        self, action: Callable[[Session, T, float], None], wish: T, sent_ns: Sequence[int]
    ) -> None:
        """``call``, with a wish that was sent at one of these times of day, as far as is known.

        Raises CommandRefused for one that has been waiting while this process stood still. Every
        refusal is delivered as well, in its place among the events.
        """
        try:
            with self._lock:
                now = time.monotonic()
                try:
                    boot_s = boot_time_s()
                    if not all(self._standstill.outlived_by(at_ns, boot_s) for at_ns in sent_ns):
                        self._heed_standstill(boot_s)
                        raise CommandRefused(WAITED)
                    action(self._session, wish, now)
                except CommandRefused as error:
                    if not self._outbox.full:
                        self._outbox.put(partial(self._refused, str(error)))
                    raise
                finally:
                    self._settle()
        finally:
            self._outbox.hand_over()

    def figures(self) -> tuple[LinkFigures, SessionFigures]:
        """All that is counted and measured, at one moment."""
        with self._changed:
            link = LinkFigures(
                port=self._name,
                trouble=self._trouble,
                opened=self._opened,
                received_bytes=self._received,
                sent_bytes=self._sent,
                overruns=self._overruns,
                waited_s=waited_s(self._threads[0].native_id or 0),
            )
            return link, self._session.figures(time.monotonic())

    def close(self, on_exit: OnExit) -> bool:
        """Stop the robot, end the threads, close the port. Harmless to repeat.

        Whether the robot was told to stand still; ``stands``: whether it was seen to.
        """
        told = False
        with self._changed:
            if not self._leaving:
                self._leaving = True
                self._on_exit = on_exit
                self._stop_for_good()
                self._write(self._session.shutdown_sequence(on_exit, time.monotonic()))
                if self._port is not None:
                    told = self._write_error is None and not self._port.missing
                    self._stands = told and self._session.stands
                    self._port.interrupt()
                    self._port = None  # nobody adds to the last words
            self._closing.set()
            self._changed.notify_all()
        *serving, teller = self._threads
        self._join(serving)
        self._outbox.close()
        self._join([teller])
        return told and not any(thread.is_alive() for thread in serving)

    @staticmethod
    def _join(threads: Sequence[threading.Thread]) -> None:
        for thread in threads:
            if thread.is_alive():
                thread.join(JOIN_TIMEOUT_S)

    @property
    def stands(self) -> bool:
        """After ``close``: the board has shown that the robot stands."""
        return self._stands

    def _stop_for_good(self) -> None:
        """With the lock held: wait, while the pacer repeats Stop, until the robot stands."""
        self._session.leave(now := time.monotonic())
        self._settle()
        alone = self._port is not None and self._keeper is None and not self._port.ends_with_us
        proof_s = self._session.proof_takes_s + self._session.board.traits.stops_within_s
        self._await_standstill(now + max(UNGUARDED_S if alone else STANDS_WITHIN_S, proof_s))
        if self._session.stands and self._session.fall_silent(now := time.monotonic()):
            self._await_standstill(now + max(SILENCE_S, proof_s))

    def _await_standstill(self, until: float) -> None:
        while self._port is not None and self._write_error is None and not self._session.stands:
            if (left_s := until - time.monotonic()) <= 0.0:
                break
            self._changed.wait(left_s)

    def _guard(self, work: Callable[[], None]) -> None:
        try:
            work()
        except BaseException as error:
            self._failed(error)

    def _serve(self) -> None:
        # Once more when it ends: a robot that was lost while it drove is still to be stopped.
        while not (leaving := self._closing.is_set()) or self._opened:
            try:
                with closing(self._open()) as port:
                    comes_back = False
                    try:
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
                self._trouble = str(error)
                self._tell(partial(self._report, self._trouble))
                self._closing.wait(self._wait_s)
                longest_s = max(LONGEST_WAIT_S, self.reconnect_interval_s)
                self._wait_s = min(BACK_OFF * self._wait_s, longest_s)

    def _attach(self, port: Transport) -> None:
        names = self._session.board.traits.channels
        missing = {
            f"the line '{names[number]}' is missing": why for number, why in port.missing.items()
        }
        self._trouble = "; ".join(f"{which}: {why}" for which, why in missing.items())
        self._tell(partial(self._report, self._trouble or None))
        keeper, notices = self._guarded(port)
        with self._changed:
            self._port, self._write_error, self._keeper = port, None, keeper
            self._opened += 1
            self._overruns, self._count_at = None, -math.inf
            self._session.opened(time.monotonic(), missing="; ".join(missing))
            if notices:
                self._outbox.put(partial(self._deliver, notices))
            self._settle()
        self._outbox.deliver()

    def _attach_anew(self, port: Transport) -> None:
        """Its lines have changed: all begins again, on those that are there now."""
        with self._changed:
            self._write(self._session.broken_off())
            self._session.closed(now := time.monotonic())
            self._session.opened(now, missing="the lines of the board are changing")
            keeper = self._keeper
        try:
            self._attach(port)
        finally:
            if keeper is not None:  # until now it was the one that guards
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
                if self._write_error is not None:
                    raise self._write_error
                if not data:
                    continue
                now = time.monotonic()
                measured = self._session.hear(data, now, channel)
                claimed = bool(measured) and self._outbox.claim()
                if measured and not claimed:
                    self._outbox.put(partial(self._deliver, measured))
            if claimed:
                try:
                    self._deliver(measured)
                finally:
                    self._outbox.release()
            elif measured:
                self._outbox.deliver()
            with self._lock:
                self._wait_s = self.reconnect_interval_s
                self._received += len(data)
                self._count(port, now)
                stopped = self._heed_standstill(boot_time_s())
                if self._session.process(now) or stopped:
                    self._settle()
                else:
                    self._tell_guard()
            self._outbox.deliver()

    def _count(self, port: Transport, now: float) -> None:
        """With the lock held: what the kernel lost, now and then."""
        if now < self._count_at:
            return
        self._count_at = now + COUNT_EVERY_S
        self._overruns = port.overruns
        if self._overruns:
            self._session.overran(self._overruns)

    def _detach(self, port: Transport, *, comes_back: bool) -> None:
        """Whatever ended the reading, the robot is not left with a command to carry out."""
        with self._changed:
            if self._write_error is None:
                self._write(self._session.shutdown_sequence(self._on_exit, time.monotonic()))
            else:  # Stop, right behind whatever is out of the kernel's reach
                port.write_if_room(self._session.broken_off())
            lines = len(port.descriptors or ())  # of several, some may be there to be stopped
            stopped = self._stands if self._closing.is_set() else comes_back and lines < 2
            keeper, self._port, self._keeper = self._keeper, None, None
            self._session.closed(time.monotonic())
            self._settle()
        if keeper is not None:
            keeper.end(stopped=stopped)
        self._outbox.deliver()

    def _pace(self) -> None:
        while True:
            with self._changed:
                if self._closing.is_set():
                    return
                now = time.monotonic()
                self._pacing_until = min(self._session.wake_at, self._beat_at)
                if now < self._pacing_until:
                    self._changed.wait(self._pacing_until - now)
                    continue
                self._beat(now)
                if now >= self._session.wake_at:
                    self._session.tick(now)
                    self._settle()
            self._outbox.hand_over()

    def _beat(self, now: float) -> None:
        """With the lock held: this thread, and so the watchdog, is alive."""
        boot_s = boot_time_s()  # read once: it may stand still between two readings
        self._heed_standstill(boot_s)
        self._standstill.passed(boot_s, time.time_ns())
        if now < self._beat_at:
            return
        self._beat_at = now + BEAT_S
        if self._keeper is None:
            return
        if trouble := self._keeper.beat(now, latched=self._session.estop_active):
            self._outbox.put(partial(self._deliver, [Notice(trouble)]))

    def _heed_standstill(self, boot_s: float) -> bool:
        """With the lock held: whether this process stood still, and the robot is to be stopped."""
        length_s = 0.0 if self._closing.is_set() else self._standstill.begun(boot_s)
        if length_s:  # the caller may have read the steady clock before it stood still
            self._session.stood_still(length_s, time.monotonic())
        return length_s > 0.0

    def _tell(self, delivery: Delivery) -> None:
        """The reader's own, of what happened without the lock."""
        self._outbox.put(delivery)
        self._outbox.deliver()

    def _settle(self) -> None:
        """With the lock held: write what is due, wake the pacer if it sleeps for too long.

        What there is to tell takes its place in the order.
        """
        packets = self._session.take_output(time.monotonic())
        self._tell_guard()
        if packets:
            self._write(packets)
        if self._session.wake_at < self._pacing_until or self._leaving:
            self._changed.notify_all()
        if events := self._session.take_events():
            self._outbox.put(partial(self._deliver, events))

    def _tell_guard(self) -> None:
        """With the lock held: what stops the board now, where that has changed."""
        if (keeper := self._keeper) is None:
            return
        if (words := self._session.board.last_words()) != keeper.last_words:
            keeper.change(*words)

    def _write(self, packets: Packets) -> None:
        if not packets or self._port is None or self._write_error is not None:
            return
        try:
            self._port.write(packets)
            self._sent += sum(len(data) for _, data in packets)
        except LinkError as error:
            self._write_error = error
            self._port.interrupt()
        else:
            if self._on_write is not None:
                for packet in packets:
                    self._outbox.put(partial(self._on_write, packet))
