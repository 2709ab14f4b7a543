# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What several threads have to tell, told in the order in which it happened.

A thread puts what happened while it holds the lock under which it happened, and delivers after it
has released that lock, so a slow listener delays no command. One thread delivers at a time; another
one that comes meanwhile leaves its part to the first. This module knows threads; it does not know
what is delivered.
"""

import threading
from collections import deque
from collections.abc import Callable
from typing import Final

MOST_WAITING: Final = 1000
"""From here on the thread that brings most of it waits for the listener."""

Delivery = Callable[[], object]


class Outbox:
    """A queue of calls: ``put`` orders them, ``deliver`` and ``serve`` make them."""

    def __init__(self) -> None:
        self._waiting: deque[Delivery] = deque()
        self._delivering = threading.Lock()
        self._handed_over = threading.Event()
        self._closed = False

    def put(self, delivery: Delivery) -> None:
        """Queue the next call. It never blocks; the caller's lock gives the order."""
        self._waiting.append(delivery)

    def claim(self) -> bool:
        """``put`` and ``deliver`` at a lower price: whether the caller may deliver by itself.

        With the lock held under which it happened. If so, ``release`` is to follow.
        """
        return not self._waiting and self._delivering.acquire(blocking=False)

    def release(self) -> None:
        """End a claim after its delivery, or its failure."""
        self._delivering.release()
        if self._waiting:
            self.deliver()

    @property
    def full(self) -> bool:
        """The listener is so slow that what can be spared is better not put."""
        return len(self._waiting) >= MOST_WAITING

    def deliver(self) -> None:
        """Make the calls that wait, unless another thread is doing so: then that one makes them.

        Raises what they raise.
        """
        waiting, delivering = self._waiting, self._delivering
        while waiting:  # again after the release: one that was put meanwhile found it taken
            if not delivering.acquire(blocking=self.full):
                return
            try:
                while waiting:
                    waiting.popleft()()
            finally:
                delivering.release()

    def hand_over(self) -> None:
        """Have another thread make the calls that wait, for a thread that must not be held up."""
        if self._waiting:
            self._handed_over.set()

    def serve(self) -> None:
        """Make the calls that are handed over, until ``close``."""
        while not self._closed:
            self._handed_over.wait()
            self._handed_over.clear()
            self.deliver()

    def close(self) -> None:
        """End ``serve`` after the calls that still wait."""
        self._closed = True
        self._handed_over.set()
