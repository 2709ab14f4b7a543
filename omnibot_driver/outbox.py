# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Calls that several threads queue, and that are made in the order of the events that caused them.

A thread puts a call while it holds the lock under which the event occurred, and delivers after it
has released that lock, so a slow listener delays no command. One thread delivers at a time; another
thread that wants to deliver meanwhile leaves its calls to the first thread. This module knows
threads; it does not know what is delivered.
"""

import threading
from collections import deque
from collections.abc import Callable
from typing import Final

MOST_WAITING: Final = 1000
"""Number of queued calls at which a thread that delivers must wait for the listener."""

Delivery = Callable[[], object]


class Outbox:
    """A queue of calls. ``put`` appends a call; ``deliver`` and ``serve`` make the calls."""

    def __init__(self) -> None:
        self._waiting: deque[Delivery] = deque()
        self._delivering = threading.Lock()
        self._handed_over = threading.Event()
        self._closed = False

    def put(self, delivery: Delivery) -> None:
        """Queue the next call without blocking. Hold the lock under which the event occurred."""
        self._waiting.append(delivery)

    def claim(self) -> bool:
        """Return whether the caller may deliver directly; this is cheaper than ``put`` and
        ``deliver``.

        During this call, hold the lock under which the event occurred. If it returns True,
        ``release`` must follow.
        """
        return not self._waiting and self._delivering.acquire(blocking=False)

    def release(self) -> None:
        """End a claim, after the delivery has succeeded or failed."""
        self._delivering.release()
        if self._waiting:
            self.deliver()

    @property
    def full(self) -> bool:
        """Whether ``MOST_WAITING`` calls wait; dispensable calls should then not be queued."""
        return len(self._waiting) >= MOST_WAITING

    def deliver(self) -> None:
        """Make the waiting calls, or leave them to the thread that is making calls now.

        If the outbox is full, wait for that thread. Raises what the calls raise.
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
        """Let the thread of ``serve`` make the waiting calls, so that the caller is not delayed."""
        if self._waiting:
            self._handed_over.set()

    def serve(self) -> None:
        """Make the calls that are handed over, until ``close``."""
        while not self._closed:
            self._handed_over.wait()
            self._handed_over.clear()
            self.deliver()

    def close(self) -> None:
        """Let ``serve`` make the calls that still wait, and then return."""
        self._closed = True
        self._handed_over.set()
