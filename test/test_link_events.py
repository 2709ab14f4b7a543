# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the events from a link to its listener: their order, and what a bad listener causes."""

import threading
import time
from collections.abc import Sequence
from functools import partial
from random import Random

import pytest
from listener import PATIENCE_S, STOP, Listener, kinds, link_to, session

from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.events import Event, Notice
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.core.session import Session
from omnibot_driver.shared_session import WAITED
from omnibot_driver.simulator.omnibot import PtyBoard

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


def test_events_of_all_threads_leave_in_the_order_in_which_they_happened(board: PtyBoard) -> None:
    """The listener gets the events of all threads in order, even if it is sometimes slow.

    The threads are a caller's thread, the reader and the pacer.
    """
    happened: list[Event] = []
    ours, listener = session(), Listener()
    hear, take_events, deliver = ours.inbound.hear, ours.take_events, listener.deliver

    def heard(data: bytes, now: float, _channel: int) -> list[ImuEstimate]:
        estimates = hear(data, now)
        happened.extend(estimates)
        return estimates

    def taken() -> list[Event]:
        events = take_events()
        happened.extend(events)
        return events

    def slowly(events: Sequence[Event]) -> None:
        time.sleep(random.choice((0.0, 0.0, 0.001)))  # a network is sometimes slow
        deliver(events)

    def press(name: str) -> None:
        for active in 20 * (True, False):
            link.call(partial(estop, active, name))
            time.sleep(0.001)  # the reader and the pacer take their turns meanwhile

    def estop(active: bool, by: str, session: Session, now: float) -> None:
        session.estop(active, now, by=by)

    random = Random(4)
    ours.inbound.hear, ours.take_events = heard, taken  # type: ignore[method-assign]
    listener.deliver = slowly  # type: ignore[method-assign]
    link = link_to(board.path, listener, ours)
    link.start()
    listener.wait_for(lambda: len(listener.events) > 20)
    pressing = [threading.Thread(target=press, args=(f"button {n}",)) for n in range(4)]
    for thread in pressing:
        thread.start()
    for thread in pressing:
        thread.join(PATIENCE_S)
    link.close("stop")
    assert listener.events == happened
    assert sum(isinstance(event, Notice) for event in happened) > 20


def test_a_listener_that_hangs_delays_no_estop_and_no_repetition(board: PtyBoard) -> None:
    """A listener hangs. Neither a caller's e-stop nor the repetition of a command waits for it.

    When the listener runs again, it gets its events in order.
    """
    listener, ours = Listener(), session()
    deliver, hang, goes_on = listener.deliver, threading.Event(), threading.Event()

    def hanging(events: Sequence[Event]) -> None:
        if hang.is_set():
            assert goes_on.wait(PATIENCE_S)
        deliver(events)

    listener.deliver = hanging  # type: ignore[method-assign]
    link = link_to(board.path, listener, ours, refused=listener.refused.append)
    link.start()
    listener.wait_for(lambda: ours.state == "nominal")
    hang.set()
    link.call(lambda s, now: s.estop(True, now, by="a button"))
    drive = partial(link.command, Session.command_twist, BodyTwist(0.3, 0.0, 0.0))
    with pytest.raises(CommandRefused):
        drive([time.time_ns()])
    assert board.wait_for(lambda b: kinds(b).count("estop") > 3, PATIENCE_S)
    link.call(lambda s, now: s.estop(False, now, by="a button"))
    assert not listener.refused
    goes_on.set()
    listener.wait_for(lambda: Notice("e-stop released by a button") in listener.events)
    link.close("stop")
    (reason,) = listener.refused
    assert "e-stop" in reason or reason == WAITED


def test_a_refusal_leaves_between_what_was_before_and_after_it(board: PtyBoard) -> None:
    """The listener gets the latch of the e-stop, then the refused command, then the release."""
    listener, ours = Listener(), session()
    link = link_to(
        board.path, listener, ours, refused=lambda text: listener.deliver([Notice(text)])
    )
    link.start()
    listener.wait_for(lambda: ours.state == "nominal")
    drive = partial(link.command, Session.command_twist, BodyTwist(0.3, 0.0, 0.0))
    for _ in range(20):
        link.call(lambda s, now: s.estop(True, now))
        with pytest.raises(CommandRefused):
            drive([time.time_ns()])
        link.call(lambda s, now: s.estop(False, now))
    link.close("stop")
    texts = [event.text for event in listener.events if isinstance(event, Notice)]
    told = [text.split()[1] for text in texts if "e-stop" in text or "refused" in text]
    assert told == 20 * ["latched", "command", "released"]


def test_a_listener_that_raises_ends_the_link_with_a_report(board: PtyBoard) -> None:
    """The listener raises an error. The link reports the error, stops the robot and ends."""
    listener = Listener()

    def explode(events: Sequence[Event]) -> None:
        if events:
            raise ZeroDivisionError

    listener.deliver = explode  # type: ignore[method-assign]
    link = link_to(board.path, listener, session())
    link.start()
    listener.wait_for(lambda: listener.failures)
    assert board.wait_for(lambda b: bytes(b.received).endswith(STOP), PATIENCE_S)
    link.close("stop")
    assert isinstance(listener.failures[0], ZeroDivisionError)
