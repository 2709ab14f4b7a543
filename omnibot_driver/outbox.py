# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A queue of calls that deliver events to listeners, in the order of the events.

The calls are made one at a time, and after the lock of the events is released, so that a slow
listener does not delay commands. This module does not know what is delivered.
"""

import threading
from collections import deque
from collections.abc import Callable
from typing import Final

MOST_WAITING: Final = 1000
"""Number of queued calls at which the queue is full. While the queue is full, ``deliver`` waits for
the thread that is making the queued calls."""

Delivery = Callable[[], object]


class Outbox:
    """A queue of calls. ``put`` appends a call. ``deliver`` and ``serve`` make the calls."""

    def __init__(self) -> None:
        self._waiting: deque[Delivery] = deque()
        self._delivering = threading.Lock()
        self._handed_over = threading.Event()
        self._closed = False

    def put(self, delivery: Delivery) -> None:
        """Append a call that delivers an event, without waiting.

        The caller must hold the lock of the events, so that the calls keep the order of the events.
        """
        self._waiting.append(delivery)

    def claim(self) -> bool:
        """Return whether the caller may bypass the queue and call the listener directly.

        The caller must hold the lock under which the event occurred. If the result is True, the
        caller must call ``release``.
        """
        return not self._waiting and self._delivering.acquire(blocking=False)

    def release(self) -> None:
        """End a successful ``claim``. The caller must call this even if the delivery has failed."""
        self._delivering.release()
        if self._waiting:
            self.deliver()

    @property
    def full(self) -> bool:
        """Whether the queue is full. The caller should then not queue a call that it can omit."""
        return len(self._waiting) >= MOST_WAITING

    def deliver(self) -> None:
        """Make the queued calls, or leave them to another thread that is making calls now.

        If the queue is full, wait for that thread. Raises the exceptions of the calls.
        """
        waiting, delivering = self._waiting, self._delivering
        while waiting:  # checked again after the release, for calls that were put meanwhile
            if not delivering.acquire(blocking=self.full):
                return
            try:
                while waiting:
                    waiting.popleft()()
            finally:
                delivering.release()

    def hand_over(self) -> None:
        """Wake the thread in ``serve``, which makes the queued calls. The caller is not delayed."""
        if self._waiting:
            self._handed_over.set()

    def serve(self) -> None:
        """Make the queued calls whenever ``hand_over`` asks for it. Return after ``close``."""
        closed = False
        while not closed:
            self._handed_over.wait()
            self._handed_over.clear()
            closed = self._closed  # read first, so that no call from before ``close`` is left
            self.deliver()

    def close(self) -> None:
        """Make ``serve`` return after it has made the calls that still wait."""
        self._closed = True
        self._handed_over.set()
