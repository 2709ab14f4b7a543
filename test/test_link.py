# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of a link: one session on one port, and the threads that serve them.

The port is a real pseudo-terminal. ROS is not used.
"""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from listener import (
    EMERGENCY_STOP,
    PATIENCE_S,
    STOP,
    Listener,
    end_patiently,
    kinds,
    link_to,
    session,
)

from omnibot_driver import driver
from omnibot_driver.boards import PROFILES, check_all, load
from omnibot_driver.core.commands.stop_proof import RAREST_S, StopProof
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.events import Notice
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.packets import joined
from omnibot_driver.core.readings import DisplacementReading
from omnibot_driver.keeper import BEAT_S, SPEAKS_WITHIN_S, Keeper
from omnibot_driver.simulator.omnibot import PtyBoard
from omnibot_driver.transports.serial_port import SerialPort

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


def test_measurements_are_delivered_on_the_reader_thread(board: PtyBoard) -> None:
    """The reader thread itself delivers measurements. A queue or a timer would add latency."""
    listener = Listener()
    link = link_to(board.path, listener, session())
    link.start()
    listener.wait_for(lambda: len(listener.events) > 20)
    link.close("stop")
    assert listener.threads == {"omnibot-reader"}
    assert listener.reports == [None]


def test_a_repeated_command_and_its_timeout_need_nobody_elses_thread(board: PtyBoard) -> None:
    """The pacer, a thread of the link, repeats commands and applies the command timeout.

    So repetition and timeout work even if the caller's thread hangs after a command.
    """
    listener, ours = Listener(), session()
    link = link_to(board.path, listener, ours)
    link.start()
    listener.wait_for(lambda: ours.state == "nominal")
    for _ in range(20):  # if the machine hangs, the robot is stopped: try again
        before = len(board.board.commands)
        link.call(lambda s, now: s.command_twist(BodyTwist(0.3, 0.0, 0.0), now))
        if board.wait_for(lambda b, n=before: kinds(b)[n:].count("velocity") > 3, 1.0):  # type: ignore[misc]
            break
    assert kinds(board.board)[before:].count("velocity") > 3
    assert board.wait_for(lambda b: kinds(b)[-1:] == ["wheels"], PATIENCE_S)
    link.close("stop")


def test_the_guard_hears_a_beat_ten_times_a_second_however_often_the_pacer_passes(
    board: PtyBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The guard process gets at most ten heartbeats a second, even if the pacer runs more often.

    With more heartbeats, a slow guard would leave too many unread, and the driver would replace the
    guard.
    """
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
    """The link counts how often its port was opened, and how many bytes were read and written.

    While the port is closed, the link says why.
    """
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


def test_closing_writes_stop_and_ends_the_threads(
    board: PtyBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Closing a link writes Stop and ends its threads. Closing it again does nothing."""
    end_patiently(monkeypatch)
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


@dataclass
class SlowShutdown:
    """A shutdown in which each proof of a standstill comes as late as the link allows."""

    proof_takes_s: float
    stands: bool = False

    def begin(self, _now: float) -> None:
        pass

    def fall_silent(self, _now: float) -> bool:
        self.stands = False
        return True


@pytest.mark.parametrize("name", PROFILES)
def test_the_process_does_not_give_up_while_the_link_waits_for_the_slowest_proofs(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The longest possible shutdown of a link takes less time than ``LONGEST_END_S``.

    After this time, the driver ends its process by force. The shutdown includes two proofs of a
    standstill, and the guard's last words.
    """
    traits = load(name).make(check_all({"board": name})).traits
    proof, slow = StopProof(traits.stands_after_s), 60.0 * RAREST_S
    proof.look(DisplacementReading(0.0, 0.0, 0.0, "body", slow, 0), 1.0)
    shutdown = SlowShutdown(proof.takes_s)
    board: Any = SimpleNamespace(shutdown=shutdown, board=SimpleNamespace(traits=traits))
    link, waits_s = link_to("sim://", Listener(), board), []

    def wait(seconds: float) -> None:
        waits_s.append(seconds)
        shutdown.stands = len(waits_s) == 1

    clock = SimpleNamespace(monotonic=lambda: sum(waits_s))
    monkeypatch.setattr("omnibot_driver.link.time", clock)
    shared: Any = link._shared
    shared.port, shared.keeper = SimpleNamespace(ends_with_us=False), object()
    shared.changed, shared.settle = SimpleNamespace(wait=wait), lambda: None
    link._stop_for_good()
    assert sum(waits_s) + SPEAKS_WITHIN_S < driver.LONGEST_END_S


def test_every_read_and_every_write_can_be_listened_to(
    board: PtyBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    """``on_read`` gets all bytes that the link reads, and ``on_write`` all bytes that it writes.

    ``on_read`` gets no bytes from before the link's start.
    """
    end_patiently(monkeypatch)
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
    # If this process stalls, its guard sends Stop too.
    sent_by_link = b"".join(written).replace(STOP, b"")
    assert board.wait_for(
        lambda b: bytes(b.received).replace(STOP, b"") == sent_by_link, PATIENCE_S
    )
    sent = b"".join(frame.data for frame in board.board.sent)
    assert b"".join(read) in sent


def test_an_estop_is_written_before_the_call_returns(
    board: PtyBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An e-stop is written before the call returns, without a wait for another thread."""
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
    """A command is rejected. The caller gets an exception, and the link continues to work."""
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
    """The driver reports once that a guard process cannot share a port of this kind (``loop://``).

    Only the driver itself can then stop the robot.
    """
    listener = Listener()
    link = link_to("loop://", listener, session())
    link.start()
    listener.wait_for(lambda: listener.events)
    notices = [event.text for event in listener.events if isinstance(event, Notice)]
    link.close("stop")
    assert len(notices) == 1
    assert "guard" in notices[0]
