# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The threads around a session, on a real pseudo-terminal and without ROS."""

import itertools
import threading
import time
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import pytest
from listener import (
    PATIENCE_S,
    STOP,
    Listener,
    link_to,
    nothing_left_behind,
    session,
    wait_for_the_end_of,
)

from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.events import Event, Notice
from omnibot_driver.core.kinematics import BodyTwist
from omnibot_driver.core.session import Session
from omnibot_driver.simulator import BoardSettings, PtyBoard, SimulatedBoard


@pytest.fixture
def board() -> Iterator[PtyBoard]:
    with PtyBoard(SimulatedBoard(BoardSettings(running=True))) as board:
        yield board


@pytest.fixture(autouse=True)
def _nothing_is_left_behind() -> Iterator[None]:
    """Every link and port that a test opens gives its threads and descriptors back."""
    with nothing_left_behind():
        yield


def test_measurements_are_delivered_on_the_reader_thread(board: PtyBoard) -> None:
    """No queue, no timer and no other thread stand between the wire and the listener."""
    listener = Listener()
    link = link_to(board.path, listener, session())
    link.start()
    listener.wait_for(lambda: len(listener.events) > 20)
    link.close("stop")
    assert listener.threads == {"omnibot-reader"}
    assert listener.reports == [None]


def test_a_repeated_command_and_its_timeout_need_nobody_elses_thread(board: PtyBoard) -> None:
    """The pacer repeats and stops, also while whoever commanded hangs."""
    listener, ours = Listener(), session()
    link = link_to(board.path, listener, ours)
    link.start()
    listener.wait_for(lambda: ours.state == "nominal")
    link.call(lambda s, now: s.command_twist(BodyTwist(0.3, 0.0, 0.0), now))
    assert board.wait_for(lambda b: [c.kind for c in b.commands].count("velocity") > 3, PATIENCE_S)
    assert board.wait_for(lambda b: b.commands[-1].kind == "wheels", PATIENCE_S)
    link.close("stop")


def test_the_figures_tell_of_the_port_and_its_bytes(board: PtyBoard, tmp_path: Path) -> None:
    """Why it cannot be had, how often it could, what went through it."""
    listener, name = Listener(), tmp_path / "board"
    link = link_to(str(name), listener, session())
    link.start()
    listener.wait_for(lambda: listener.reports)
    figures, _ = link.figures()
    assert (figures.port, figures.opened) == (str(name), 0)
    assert "does not exist" in figures.trouble
    name.symlink_to(board.path)
    listener.wait_for(lambda: len(listener.events) >= 50)
    figures, measured = link.figures()
    link.close("stop")
    assert (figures.trouble, figures.opened) == ("", 1)
    assert figures.received_bytes >= 14 * measured.tally.imu > 0
    assert figures.sent_bytes >= len(bytes(8) + STOP)


def test_closing_writes_stop_and_ends_the_threads(board: PtyBoard) -> None:
    """Also when it is closed twice."""
    listener, ours = Listener(), session()
    link = link_to(board.path, listener, ours)
    link.start()
    listener.wait_for(lambda: ours.state == "nominal")
    link.call(lambda s, now: s.command_twist(BodyTwist(0.3, 0.0, 0.0), now))
    link.close("stop")
    link.close("stop")
    assert board.wait_for(lambda b: bytes(b.received).endswith(STOP), PATIENCE_S)
    assert ours.state == "disconnected"


def test_a_port_that_is_opened_while_the_link_is_closed_gets_the_farewell_too(
    board: PtyBoard,
) -> None:
    """The robot may still be driving by what it was told before the port was lost."""
    listener = Listener()
    closer = threading.Thread(target=lambda: link.close("stop"))

    def close_first(_trouble: str | None) -> None:
        closer.start()
        wait_for_the_end_of("omnibot-pacer")

    listener.report = close_first  # type: ignore[method-assign]
    link = link_to(board.path, listener, session())
    link.start()
    assert board.wait_for(lambda b: bytes(b.received).endswith(STOP), PATIENCE_S)
    closer.join(PATIENCE_S)
    wait_for_the_end_of("omnibot-reader")


def test_a_robot_that_was_lost_while_it_drove_is_told_to_stop_at_the_end(tmp_path: Path) -> None:
    """The cable is in again, and the driver ends before it would have tried the port anew."""
    name = tmp_path / "omnibot"
    listener, ours = Listener(), session()
    link = link_to(str(name), listener, ours)
    link.reconnect_interval_s = 3600.0
    with PtyBoard(SimulatedBoard(BoardSettings(running=True)), str(name)):
        link.start()
        listener.wait_for(lambda: ours.state == "nominal")
    listener.wait_for(lambda: len(listener.reports) == 2)
    with PtyBoard(SimulatedBoard(BoardSettings(running=True)), str(name)) as board:
        link.close("stop")
        assert board.wait_for(lambda b: bytes(b.received).endswith(STOP), PATIENCE_S)
    wait_for_the_end_of("omnibot-reader")


def test_every_read_and_every_write_can_be_listened_to(board: PtyBoard) -> None:
    """Byte for byte as they were, the opening and the farewell included."""
    read, written = [], []
    listener, ours = Listener(), session()
    link = link_to(board.path, listener, ours, on_read=read.append, on_write=written.append)
    link.start()
    listener.wait_for(lambda: len(listener.events) > 20)
    link.close("stop")
    assert written[-1] == STOP
    assert board.wait_for(lambda b: b.received == b"".join(written), PATIENCE_S)
    sent = b"".join(frame.data for frame in board.board.sent)
    assert len(read) > 10
    assert sent.startswith(b"".join(read))


def test_a_refused_command_raises_where_it_was_given(board: PtyBoard) -> None:
    """And the link goes on."""
    listener, ours = Listener(), session()
    link = link_to(board.path, listener, ours)
    link.start()
    listener.wait_for(lambda: ours.state == "nominal")
    with pytest.raises(CommandRefused):
        link.call(lambda s, now: s.command_twist(BodyTwist(float("nan"), 0.0, 0.0), now))
    link.call(lambda s, now: s.command_twist(BodyTwist(0.3, 0.0, 0.0), now))
    assert board.wait_for(lambda b: b.commands[-1].kind == "velocity", PATIENCE_S)
    link.close("stop")


def test_a_port_that_comes_late_is_opened(tmp_path: Path) -> None:
    """Closing works before, too."""
    listener, ours = Listener(), session()
    name = str(tmp_path / "omnibot")
    link = link_to(name, listener, ours)
    link.start()
    listener.wait_for(lambda: len(listener.reports) > 2)
    with PtyBoard(SimulatedBoard(), name):
        listener.wait_for(lambda: ours.state == "nominal")
        link.close("stop")
    never = link_to(name, Listener(), session())
    never.start()
    never.close("stop")


def test_attempts_are_made_less_and_less_often_up_to_a_limit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Each wait is half as long again as the one before; a limit keeps the board from waiting."""

    class Timed(Listener):
        def report(self, trouble: str | None) -> None:
            times.append(time.monotonic())
            super().report(trouble)

    listener, times = Timed(), list[float]()
    link = link_to("/no/such/port", listener, session())
    link.start()
    listener.wait_for(lambda: len(listener.reports) >= 6)
    link.close("stop")
    for number, (before, after) in enumerate(itertools.pairwise(times[:6])):
        assert after - before >= 0.02 * 1.5**number
    monkeypatch.setattr("omnibot_driver.link.LONGEST_WAIT_S", 0.0)
    listener = Listener()
    link = link_to("/no/such/port", listener, session())
    link.start()
    listener.wait_for(lambda: len(listener.reports) > 40)  # unlimited, that took days
    link.close("stop")


def test_a_board_plugged_in_under_another_name_is_found_and_stands_still(tmp_path: Path) -> None:
    """Behind the link that udev keeps; the command from before is forgotten."""
    name = tmp_path / "omnibot"
    listener, ours = Listener(), session()
    with PtyBoard(SimulatedBoard()) as second:
        with PtyBoard(SimulatedBoard(), str(name)) as first:
            link = link_to(str(name), listener, ours)
            link.start()
            listener.wait_for(lambda: ours.state == "nominal")
            link.call(lambda s, now: s.command_twist(BodyTwist(0.3, 0.0, 0.0), now))
            assert first.wait_for(lambda b: b.commands[-1].kind == "velocity", PATIENCE_S)
        listener.wait_for(lambda: ours.state == "disconnected")
        name.symlink_to(second.path)
        listener.wait_for(lambda: ours.state == "nominal")
        assert second.wait_for(lambda b: b.commands[-1].kind == "wheels", PATIENCE_S)
        with second.lock:
            assert "velocity" not in [command.kind for command in second.board.commands]
        link.call(lambda s, now: s.command_twist(BodyTwist(0.3, 0.0, 0.0), now))
        assert second.wait_for(lambda b: b.commands[-1].kind == "velocity", PATIENCE_S)
        link.close("stop")
        assert first.path != second.path


def test_a_port_that_no_guard_can_share_is_told_once(board: PtyBoard) -> None:
    """The driver is then the only one who can stop the robot."""
    listener = Listener()
    link = link_to("loop://", listener, session())
    link.start()
    listener.wait_for(lambda: listener.events)
    notices = [event.text for event in listener.events if isinstance(event, Notice)]
    link.close("stop")
    assert len(notices) == 1
    assert "guard" in notices[0]


def test_a_command_that_waited_while_the_watchdog_stood_still_is_refused(
    board: PtyBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever holds the lock keeps the pacer from passing; what is sent later is obeyed."""
    monkeypatch.setattr("omnibot_driver.standstill.SETTLE_S", 0.0)
    listener, ours = Listener(), session()
    link = link_to(board.path, listener, ours)
    link.start()
    listener.wait_for(lambda: ours.state == "nominal")
    link.call(lambda s, now: s.command_twist(BodyTwist(0.3, 0.0, 0.0), now))
    drive = partial(link.command, lambda s, now: s.command_twist(BodyTwist(0.2, 0.0, 0.0), now))
    drive(time.time_ns())
    hold, held = threading.Event(), threading.Event()

    def hang(_session: Session, _now: float) -> None:
        held.set()
        hold.wait(PATIENCE_S)

    holder = threading.Thread(target=link.call, args=(hang,))
    holder.start()
    held.wait(PATIENCE_S)
    assert board.wait_for(lambda b: b.estopped, PATIENCE_S)
    sent_ns = time.time_ns()
    hold.set()
    holder.join(PATIENCE_S)
    with pytest.raises(CommandRefused, match="waited"):
        drive(sent_ns)
    listener.wait_for(lambda: any("stood still" in str(event) for event in listener.events))
    assert board.wait_for(lambda b: bytes(b.received).endswith(STOP), PATIENCE_S)
    drive(time.time_ns())
    link.close("stop")


def test_an_unplugged_port_is_reported_and_ends_the_state() -> None:
    """The terminal hangs up."""
    listener, ours = Listener(), session()
    with PtyBoard(SimulatedBoard()) as board:
        link = link_to(board.path, listener, ours)
        link.start()
        listener.wait_for(lambda: ours.state == "nominal")
    listener.wait_for(lambda: ours.state == "disconnected" and len(listener.reports) > 1)
    assert not link.blocked, "there is no port"
    link.close("stop")
    assert "lost" in str(listener.reports[1])


def test_a_listener_that_raises_ends_the_link_with_a_report(board: PtyBoard) -> None:
    """A thread never dies unheard, and the robot is stopped before the port is given back."""
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
