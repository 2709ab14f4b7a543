# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of a driver that did not run for a while: it stops the robot and refuses old commands."""

import threading
import time
from collections.abc import Callable, Sequence
from functools import partial

import pytest
from listener import PATIENCE_S, STOP, Listener, kinds, link_to, session

from omnibot_driver import stall_detector
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.readings import Reading
from omnibot_driver.core.session import Session
from omnibot_driver.simulator.omnibot import PtyBoard

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


def obeyed(command: Callable[[], None]) -> bool:
    """Return whether the command is accepted.

    After a stall, the driver refuses every command until the pacer has run. So a test may have to
    call this function several times.
    """
    try:
        command()
    except CommandRefused:
        return False
    return True


def test_a_command_that_waited_while_the_pacer_stood_still_is_refused(
    board: PtyBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A command that waited while the pacer could not run is refused; new commands are obeyed.

    In this test, the pacer cannot run because another thread holds the session's lock.
    """
    monkeypatch.setattr("omnibot_driver.stall_detector.SETTLE_S", 0.0)
    listener, ours = Listener(), session()
    link = link_to(board.path, listener, ours)
    link.start()
    listener.wait_for(lambda: ours.state == "nominal")
    drive = partial(link.command, Session.command_twist, BodyTwist(0.2, 0.0, 0.0))
    for _ in range(20):  # if the machine hangs, that is another stall: try again
        listener.wait_for(lambda: obeyed(lambda: drive([time.time_ns()])))
        if board.wait_for(lambda b: b.driven, 0.3):
            break
    else:
        raise AssertionError("it does not drive")
    hold, held = threading.Event(), threading.Event()

    def hang(_session: Session, _now: float) -> None:
        held.set()
        hold.wait(PATIENCE_S)

    holder = threading.Thread(target=link.call, args=(hang,))
    holder.start()
    held.wait(PATIENCE_S)
    assert board.wait_for(lambda b: not b.driven, PATIENCE_S)
    sent_ns = time.time_ns()
    hold.set()
    holder.join(PATIENCE_S)
    with pytest.raises(CommandRefused, match="waited"):
        drive([sent_ns])
    with pytest.raises(CommandRefused, match="waited while the driver was stalled"):
        drive([time.time_ns(), sent_ns])  # a new sender has two possible times of sending
    listener.wait_for(lambda: any("stalled" in str(event) for event in listener.events))
    assert board.wait_for(lambda b: bytes(b.received).endswith(STOP), PATIENCE_S)

    listener.wait_for(lambda: obeyed(lambda: drive([time.time_ns()])))
    link.close("stop")


def test_a_suspended_host_has_stood_still(board: PtyBoard, monkeypatch: pytest.MonkeyPatch) -> None:
    """The computer is suspended during a drive. When it resumes, the driver stops the robot.

    The driver notices the suspension by a clock that also runs while the computer is suspended.
    """
    suspended_s = 0.0
    monkeypatch.setattr(
        "omnibot_driver.shared_session.boot_time_s",
        lambda: stall_detector.boot_time_s() + suspended_s,
    )
    monkeypatch.setattr("omnibot_driver.stall_detector.SETTLE_S", 0.0)
    listener, ours = Listener(), session()
    link = link_to(board.path, listener, ours)
    link.start()
    listener.wait_for(lambda: ours.state == "nominal")
    drive = partial(link.command, Session.command_twist, BodyTwist(0.3, 0.0, 0.0))
    for _ in range(20):  # if the machine hangs, that is another stall: try again
        listener.wait_for(lambda: obeyed(lambda: drive([time.time_ns()])))
        if board.wait_for(lambda b: kinds(b)[-1:] == ["velocity"], 0.3):
            break
    else:
        raise AssertionError("it does not drive")
    sent_ns = time.time_ns()
    suspended_s = 3600.0
    assert board.wait_for(lambda b: kinds(b)[-1:] == ["wheels"], PATIENCE_S)
    listener.wait_for(lambda: any("for 36" in str(event) for event in listener.events))
    with pytest.raises(CommandRefused, match="waited"):
        drive([sent_ns])
    before = len(board.board.commands)
    listener.wait_for(lambda: obeyed(lambda: drive([time.time_ns()])))
    assert board.wait_for(lambda b: "velocity" in kinds(b)[before:], PATIENCE_S)
    link.close("stop")


def test_a_stall_is_noticed_before_the_bytes_that_waited_are_decoded(
    board: PtyBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A thread holds the session's lock for half a second, so bytes wait to be read.

    The board's codec is informed of the stall before it receives these bytes.
    """
    listener, ours = Listener(), session()
    link = link_to(board.path, listener, ours)
    link.start()
    listener.wait_for(lambda: ours.state == "nominal")
    codec, order = ours.board, list[str]()
    receive, stalled = codec.receive, codec.stalled

    def hear(data: bytes, now: float, channel: int = 0) -> Sequence[Reading]:
        order.append("bytes")
        return receive(data, now, channel)

    def stall() -> None:
        order.append("stall")
        stalled()

    monkeypatch.setattr(codec, "receive", hear)
    monkeypatch.setattr(codec, "stalled", stall)
    heard: list[int] = []

    def hang(_session: Session, _now: float) -> None:
        heard.append(len(order))
        end_s = time.monotonic() + 0.6
        assert board.wait_for(lambda _: time.monotonic() >= end_s, PATIENCE_S)

    drive = partial(link.command, Session.command_twist, BodyTwist(0.2, 0.0, 0.0))
    listener.wait_for(lambda: obeyed(lambda: drive([time.time_ns()])))  # no stall is left
    link.call(hang)
    listener.wait_for(lambda: any("stalled" in str(event) for event in listener.events))
    link.close("stop")
    assert order[heard[0]] == "stall"


def test_a_command_at_the_end_of_a_shutdown_is_not_refused_because_of_a_stall(
    board: PtyBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The driver shuts down, so the pacer has ended. Commands still arrive until the process ends.

    The driver refuses them because it shuts down. It does not report a stall.
    """
    ended_s = 0.0
    monkeypatch.setattr(
        "omnibot_driver.shared_session.boot_time_s",
        lambda: stall_detector.boot_time_s() + ended_s,
    )
    listener, ours = Listener(), session()
    link = link_to(board.path, listener, ours)
    link.start()
    listener.wait_for(lambda: ours.state == "nominal")
    link.close("stop")
    ended_s = 1.0
    with pytest.raises(CommandRefused, match="shutting down"):
        link.command(Session.command_twist, BodyTwist(0.2, 0.0, 0.0), [time.time_ns()])
