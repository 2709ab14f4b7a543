# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the outbox, a queue of calls.

Threads append calls to the queue, and make the calls in order, one at a time.
"""

import random
import threading
import time
from collections.abc import Callable
from functools import partial

import pytest

from omnibot_driver.outbox import MOST_WAITING, Outbox

PATIENCE_S = 60.0


def in_threads(*works: Callable[[], object]) -> None:
    """Run all functions at once, each in a thread, until all are done."""
    threads = [threading.Thread(target=work) for work in works]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(PATIENCE_S)
        assert not thread.is_alive()


class Held:
    """Keeps the outbox busy: a thread delivers one event, and ends only after ``let_go``."""

    def __init__(self, outbox: Outbox) -> None:
        self._begun, self._over = threading.Event(), threading.Event()
        outbox.put(self._deliver)
        self._thread = threading.Thread(target=outbox.deliver)
        self._thread.start()
        assert self._begun.wait(PATIENCE_S)

    def let_go(self) -> None:
        self._over.set()
        self._thread.join(PATIENCE_S)
        assert not self._thread.is_alive()

    def _deliver(self) -> None:
        self._begun.set()
        assert self._over.wait(PATIENCE_S)


@pytest.mark.parametrize("seed", range(5))
def test_everything_leaves_once_in_the_order_of_the_lock_and_one_at_a_time(seed: int) -> None:
    """Six threads put events into the outbox, with waits of random length between them.

    Each event is delivered once, and all are delivered in order.
    """
    outbox, lock = Outbox(), threading.Lock()
    happened: list[int] = []
    left: list[int] = []
    under_way = 0

    def deliver(number: int, pause_s: float) -> None:
        nonlocal under_way
        under_way += 1
        assert under_way == 1
        time.sleep(pause_s)  # lets another thread run in the middle of a delivery
        left.append(number)
        under_way -= 1

    def happen(own_seed: int) -> None:
        chance = random.Random(own_seed)
        for _ in range(60):
            with lock:
                claimed = chance.random() < 0.5 and outbox.claim()
                mine = partial(deliver, len(happened), chance.choice((0.0, 0.0, 1e-4)))
                happened.append(len(happened))
                if not claimed:
                    outbox.put(mine)
            time.sleep(chance.choice((0.0, 1e-5, 1e-4)))  # lets another thread overtake this one
            if claimed:
                mine()
                outbox.release()
            else:
                chance.choice((outbox.deliver, outbox.hand_over))()

    teller = threading.Thread(target=outbox.serve)
    teller.start()
    in_threads(*(partial(happen, 100 * seed + number) for number in range(6)))
    outbox.close()
    teller.join(PATIENCE_S)
    assert left == happened == list(range(len(happened)))
    assert len(happened) > 200


def test_nobody_claims_what_is_not_next() -> None:
    """``claim`` allows a direct delivery only if no event waits and no other thread delivers."""
    outbox = Outbox()
    held = Held(outbox)
    assert not outbox.claim()
    held.let_go()
    outbox.put(lambda: None)
    assert not outbox.claim()
    outbox.deliver()
    assert outbox.claim()
    outbox.release()


def test_nobody_waits_for_a_delivery_of_another_thread() -> None:
    """One thread delivers. Another thread puts events into the outbox and returns at once.

    The first thread delivers the new events when it has delivered its own event.
    """
    outbox = Outbox()
    left: list[str] = []
    held = Held(outbox)
    for name in ("a command", "a stop"):
        outbox.put(partial(left.append, name))
        outbox.deliver()
        outbox.hand_over()
    assert left == []
    held.let_go()
    assert left == ["a command", "a stop"]


def test_a_delivery_that_fails_ends_the_one_who_made_it_and_no_other() -> None:
    """A delivery raises an error in the thread that delivers.

    The events that are still in the outbox are delivered by the next call of ``deliver``.
    """
    outbox = Outbox()
    left: list[int] = []

    def fail() -> None:
        raise ZeroDivisionError

    outbox.put(fail)
    outbox.put(partial(left.append, 1))
    with pytest.raises(ZeroDivisionError):
        outbox.deliver()
    assert left == []
    outbox.deliver()
    assert left == [1]


def test_what_is_put_by_a_delivery_leaves_as_well() -> None:
    """A delivery puts an event into the outbox. That event is delivered next."""
    outbox = Outbox()
    left: list[int] = []
    outbox.put(lambda: outbox.put(partial(left.append, 2)) or left.append(1))
    outbox.deliver()
    assert left == [1, 2]


def test_a_call_that_is_put_just_before_the_end_leaves_as_well() -> None:
    """The serving thread has made all calls. Then a last call is put, and the outbox is closed.

    The serving thread makes this call before it ends.
    """
    left: list[str] = []

    class Closing(Outbox):
        def deliver(self) -> None:
            super().deliver()
            if not self._closed:
                self.put(lambda: left.append("last"))
                self.hand_over()
                self.close()

    outbox = Closing()
    outbox.put(lambda: left.append("first"))
    outbox.hand_over()
    in_threads(outbox.serve)
    assert left == ["first", "last"]


def test_whoever_brings_more_than_can_be_told_waits() -> None:
    """If the outbox is full, ``deliver`` waits while another thread makes the queued calls.

    Without this wait, the outbox could grow without limit.
    """
    outbox = Outbox()
    left: list[int] = []
    held = Held(outbox)
    assert not outbox.full
    for number in range(MOST_WAITING):
        outbox.put(partial(left.append, number))
    assert outbox.full
    reader = threading.Thread(target=outbox.deliver)
    reader.start()
    reader.join(0.1)
    assert reader.is_alive()
    held.let_go()
    reader.join(PATIENCE_S)
    assert not reader.is_alive()
    assert left == list(range(MOST_WAITING))
