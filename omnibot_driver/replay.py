# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A session that is fed from a recording: the counterpart of `Link` for recorded bytes.

The output does not depend on the playback speed. Packets to the board are discarded.
"""

import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Final, TypeVar

from omnibot_driver.core.errors import CommandRefused, LinkError
from omnibot_driver.core.events import Event, Notice
from omnibot_driver.core.packets import Packet
from omnibot_driver.core.requests import OnExit
from omnibot_driver.core.session import Session
from omnibot_driver.outbox import Delivery, Outbox
from omnibot_driver.recording import Recording

JOIN_TIMEOUT_S: Final = 1.0
SHORTEST_STEP_S: Final = 0.001
"""Shortest time between two calls of ``Session.tick``, in s, even if the session asks for less."""
LONGEST_PAUSE_S: Final = 10.0
"""Longest part of a pause that is played, in s. By the end of this time, the session has noticed
the silence, and its state no longer changes."""

T = TypeVar("T")


class Replay:
    """One session on one recording, which is played once.

    * ``deliver``: receives events, and the time of day in ns at the session's time 0.
    * ``report``: receives None when the playback begins.
    * ``failed``: receives the exception that ended the playback thread, which is always a bug.
    * ``refused``: receives the reason for each refused command.

    The replay calls ``deliver``, ``report`` and ``refused`` one at a time, in the order of the
    events.
    """

    def __init__(
        self,
        session: Session,
        recording: Recording,
        *,
        deliver: Callable[[Sequence[Event], int], None],
        report: Callable[[None], None],
        failed: Callable[[BaseException], None],
        refused: Callable[[str], None] = lambda _reason: None,
    ) -> None:
        self._session = session
        self._recording = recording
        self._deliver = deliver
        self._report = report
        self._failed = failed
        self._refused = refused
        self._outbox = Outbox()
        self._lock = threading.Lock()
        self._closing = threading.Event()
        self._now = self._began_at = 0.0
        self._epoch_ns = 0
        self._thread = threading.Thread(target=self._guard, name="omnibot-replay", daemon=True)

    def start(self) -> None:
        """Start the thread, which begins the playback after the delay in the recording's URL."""
        self._thread.start()

    def call(self, action: Callable[[Session, float], T]) -> T:
        """Call ``action`` with the session and the current time of the recording, in s."""
        try:
            with self._lock:
                try:
                    return action(self._session, self._now)
                except CommandRefused as error:
                    self._outbox.put(partial(self._refused, str(error)))
                    raise
                finally:
                    self._settle()
        finally:
            self._outbox.deliver()

    unstopped: Final = False
    """Always False, because a recording does not move a robot."""

    @property
    def blocked(self) -> bool:
        """Always False, because nothing is written."""
        return False

    def command(
        self,
        action: Callable[[Session, T, float], None],
        wish: T,
        _sent_ns: Sequence[int],
        *,
        moves_base: bool = True,
    ) -> None:
        """Pass a motion command on, like ``Link.command``. Nothing is sent to a robot."""
        self.call(lambda session, now: action(session, wish, now))

    def close(self, _on_exit: OnExit) -> bool:
        """End the thread. Return False, because a recording has no robot to stop.

        A second call does nothing.
        """
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join(JOIN_TIMEOUT_S)
        return False

    def _guard(self) -> None:
        try:
            self._play()
        except BaseException as error:
            self._failed(error)

    def _play(self) -> None:
        if self._closing.wait(self._recording.delay_s):
            return
        end = "the recording has ended; press ctrl-C to end the driver"
        opened = False
        try:
            for at_ns, packet in self._recording.chunks():
                if not opened:
                    opened, self._epoch_ns, self._began_at = True, at_ns, time.monotonic()
                    self._tell(partial(self._report, None))
                    self.call(lambda session, now: session.opened(now))
                if not self._run_until((at_ns - self._epoch_ns) * 1e-9):
                    self.call(_leave)  # a request in progress needs an answer
                    return
                self.call(partial(_hear, packet))
        except LinkError as error:
            end = str(error)
        self.call(lambda session, now: session.closed(now))
        self._tell(partial(self._deliver, [Notice(end)], self._epoch_ns))

    def _run_until(self, end_s: float) -> bool:
        """Call ``Session.tick`` at each due time until ``end_s``, but skip most of a long pause.

        Returns False if ``close`` is called meanwhile.
        """
        pause_s = end_s - self._now
        if pause_s > LONGEST_PAUSE_S:
            notice = Notice(
                f"the recording has no data for {pause_s:.0f} s here, or the recorder's clock was"
                f" set; the replay skips all but {LONGEST_PAUSE_S:.0f} s of this pause"
            )
            self._tell(partial(self._deliver, [notice], self._epoch_ns))
            if not self._tick_until(self._now + LONGEST_PAUSE_S):
                return False
            self._began_at -= (end_s - self._now) / self._recording.speed
            return self._pass(end_s)
        return self._tick_until(end_s)

    def _tick_until(self, end_s: float) -> bool:
        while (due_s := self._due()) < end_s:
            if not self._pass(due_s):
                return False
            self.call(lambda session, now: session.tick(now))
        return self._pass(end_s)

    def _due(self) -> float:
        with self._lock:
            return max(self._session.wake_at, self._now + SHORTEST_STEP_S)

    def _pass(self, until_s: float) -> bool:
        at_s = self._began_at + until_s / self._recording.speed
        if self._closing.wait(max(0.0, at_s - time.monotonic())):
            return False
        with self._lock:
            self._now = max(self._now, until_s)
        return True

    def _tell(self, delivery: Delivery) -> None:
        self._outbox.put(delivery)
        self._outbox.deliver()

    def _settle(self) -> None:
        self._session.take_output(self._now)
        if events := self._session.take_events():
            self._outbox.put(partial(self._deliver, events, self._epoch_ns))


def _hear(packet: Packet, session: Session, now: float) -> None:
    channel, data = packet
    session.inbound.receive(data, now, channel)


def _leave(session: Session, now: float) -> None:
    session.shutdown.begin(now)
    session.closed(now)
