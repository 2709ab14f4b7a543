# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The threads around a session, on a real pseudo-terminal and without ROS."""

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from random import Random

import pytest
from listener import EMERGENCY_STOP, PATIENCE_S, STOP, Listener, kinds, link_to, session

from omnibot_driver import stall_detector
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.events import Event, Notice
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.core.packets import joined
from omnibot_driver.core.session import Session
from omnibot_driver.keeper import BEAT_S, Keeper
from omnibot_driver.simulator.omnibot import BoardSettings, PtyBoard, SimulatedBoard
from omnibot_driver.transports.serial_port import SerialPort

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


@pytest.fixture
def board() -> Iterator[PtyBoard]:
    with PtyBoard(SimulatedBoard(BoardSettings(running=True))) as board:
        yield board


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
    """The pacer repeats and stops, also while the commanding callback hangs."""
    listener, ours = Listener(), session()
    link = link_to(board.path, listener, ours)
    link.start()
    listener.wait_for(lambda: ours.state == "nominal")
    for _ in range(20):  # a machine that hangs stops the robot
        before = len(board.board.commands)
        link.call(lambda s, now: s.command_twist(BodyTwist(0.3, 0.0, 0.0), now))
        if board.wait_for(lambda b, n=before: kinds(b)[n:].count("velocity") > 3, 1.0):  # type: ignore[misc]
            break
    assert kinds(board.board)[before:].count("velocity") > 3
    assert board.wait_for(lambda b: b.commands[-1].kind == "wheels", PATIENCE_S)
    link.close("stop")


def test_the_guard_hears_a_beat_ten_times_a_second_however_often_the_pacer_passes(
    board: PtyBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each repetition of a command is a pass; a guard that hangs is known by unread beats."""
    beats: list[float] = []
    monkeypatch.setattr(Keeper, "beat", lambda _keeper, now, *, latched: beats.append(now) or "")
    listener, ours = Listener(), session()
    link = link_to(board.path, listener, ours)
    link.start()
    listener.wait_for(lambda: ours.state == "nominal")

    def driven() -> bool:
        link.call(lambda s, now: s.command_twist(BodyTwist(0.3, 0.0, 0.0), now))
        return len(beats) > 10

    listener.wait_for(driven)
    link.close("stop")
    assert all(later >= earlier + BEAT_S for earlier, later in pairwise(beats))


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
    assert figures.sent_bytes >= len(STOP)


def test_closing_writes_stop_and_ends_the_threads(board: PtyBoard) -> None:
    """It may be closed twice."""
    listener, ours = Listener(), session()
    link = link_to(board.path, listener, ours)
    link.start()
    listener.wait_for(lambda: ours.state == "nominal")
    link.call(lambda s, now: s.command_twist(BodyTwist(0.3, 0.0, 0.0), now))
    assert link.close("stop")
    assert link.stands
    assert not link.close("stop")
    assert board.wait_for(lambda b: bytes(b.received).endswith(STOP), PATIENCE_S)
    assert ours.state == "disconnected"


def test_every_read_and_every_write_can_be_listened_to(board: PtyBoard) -> None:
    """Byte for byte as they were, the opening and the final Stop included."""
    read, written = [], []
    listener, ours = Listener(), session()
    link = link_to(
        board.path,
        listener,
        ours,
        on_read=lambda packet: read.append(packet[1]),
        on_write=lambda packet: written.append(packet[1]),
    )
    link.start()
    listener.wait_for(lambda: len(read) > 10)
    link.close("stop")
    assert written[-1].endswith(STOP)
    assert board.wait_for(lambda b: b.received == b"".join(written), PATIENCE_S)
    sent = b"".join(frame.data for frame in board.board.sent)
    assert sent.startswith(b"".join(read))


def test_an_estop_is_written_before_the_call_returns(
    board: PtyBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The answer does not wait for another thread."""
    written: list[bytes] = []
    write = SerialPort.write
    monkeypatch.setattr(
        SerialPort,
        "write",
        lambda port, packets: write(port, packets) or written.append(joined(packets)),
    )
    listener, ours = Listener(), session()
    link = link_to(board.path, listener, ours)
    link.start()
    listener.wait_for(lambda: ours.state == "nominal")
    link.call(lambda s, now: s.estop(True, now))
    assert EMERGENCY_STOP in b"".join(written)
    link.close("stop")


def test_a_refused_command_raises_where_it_was_given(board: PtyBoard) -> None:
    """The link goes on."""
    listener, ours = Listener(), session()
    link = link_to(board.path, listener, ours)
    link.start()
    listener.wait_for(lambda: ours.state == "nominal")
    with pytest.raises(CommandRefused):
        link.call(lambda s, now: s.command_twist(BodyTwist(float("nan"), 0.0, 0.0), now))
    link.call(lambda s, now: s.command_twist(BodyTwist(0.3, 0.0, 0.0), now))
    assert board.wait_for(lambda b: "velocity" in kinds(b), PATIENCE_S)
    link.close("stop")


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


def obeyed(command: Callable[[], None]) -> bool:
    """Commands may be refused just after a stall, when the reader runs before the pacer."""
    try:
        command()
    except CommandRefused:
        return False
    return True


def test_a_command_that_waited_while_the_watchdog_stood_still_is_refused(
    board: PtyBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A thread with the lock keeps the pacer from passing; what is sent later is obeyed."""
    monkeypatch.setattr("omnibot_driver.stall_detector.SETTLE_S", 0.0)
    listener, ours = Listener(), session()
    link = link_to(board.path, listener, ours)
    link.start()
    listener.wait_for(lambda: ours.state == "nominal")
    drive = partial(link.command, Session.command_twist, BodyTwist(0.2, 0.0, 0.0))
    for _ in range(20):  # a machine that hangs is another standstill
        if obeyed(lambda: drive([time.time_ns()])) and board.wait_for(lambda b: b.driven, 0.3):
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
        drive([time.time_ns(), sent_ns])  # or so, as little is known of its sender
    listener.wait_for(lambda: any("stalled" in str(event) for event in listener.events))
    assert board.wait_for(lambda b: bytes(b.received).endswith(STOP), PATIENCE_S)

    listener.wait_for(lambda: obeyed(lambda: drive([time.time_ns()])))
    link.close("stop")


def test_a_suspended_host_has_stood_still(board: PtyBoard, monkeypatch: pytest.MonkeyPatch) -> None:
    """No thread misses a beat by the steady clock; the robot is still stopped."""
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
    for _ in range(20):  # a machine that hangs is another standstill
        fresh = obeyed(lambda: drive([time.time_ns()]))
        if fresh and board.wait_for(lambda b: b.commands[-1].kind == "velocity", 0.3):
            break
    else:
        raise AssertionError("it does not drive")
    suspended_s = 3600.0
    assert board.wait_for(lambda b: b.commands[-1].kind == "wheels", PATIENCE_S)
    listener.wait_for(lambda: any("for 36" in str(event) for event in listener.events))
    with pytest.raises(CommandRefused, match="waited"):
        drive([time.time_ns() - 1_000_000_000])  # while it was suspended, by a clock that went on
    listener.wait_for(lambda: obeyed(lambda: drive([time.time_ns()])))
    assert board.wait_for(lambda b: b.commands[-1].kind == "velocity", PATIENCE_S)
    link.close("stop")


def test_events_of_all_threads_leave_in_the_order_in_which_they_happened(board: PtyBoard) -> None:
    """Callers, the reader and the pacer, with a listener that is now and then slow."""
    happened: list[Event] = []
    ours, listener = session(), Listener()
    hear, take_events, deliver = ours.hear, ours.take_events, listener.deliver

    def heard(data: bytes, now: float, _channel: int) -> list[ImuEstimate]:
        estimates = hear(data, now)
        happened.extend(estimates)
        return estimates

    def taken() -> list[Event]:
        events = take_events()
        happened.extend(events)
        return events

    def slowly(events: Sequence[Event]) -> None:
        time.sleep(random.choice((0.0, 0.0, 0.001)))  # a network now and then is
        deliver(events)

    def press(name: str) -> None:
        for active in 20 * (True, False):
            link.call(partial(estop, active, name))
            time.sleep(0.001)

    def estop(active: bool, by: str, session: Session, now: float) -> None:
        session.estop(active, now, by=by)

    random = Random(4)
    ours.hear, ours.take_events = heard, taken  # type: ignore[method-assign]
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
    """The call and the watchdog's thread do not wait; what was missed is delivered in order."""
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
    assert "e-stop" in listener.refused[0]


def test_a_refusal_leaves_between_what_was_before_and_after_it(board: PtyBoard) -> None:
    """The log says why."""
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
