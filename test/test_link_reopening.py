# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of a port that appears late, disappears, comes back, or comes back during the shutdown."""

import itertools
import threading
import time
from pathlib import Path

import pytest
from listener import (
    PATIENCE_S,
    STOP,
    Listener,
    end_patiently,
    kinds,
    link_to,
    session,
    wait_for_the_end_of,
)

from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.simulator.omnibot import BoardSettings, PtyBoard, SimulatedBoard

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


def test_a_port_that_comes_late_is_opened(tmp_path: Path) -> None:
    """A port appears late. The link opens it then.

    A second link waits for a port that never appears. This link can be closed while it waits.
    """
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
    """The port is missing, so the link tries again and again to open it.

    Each wait is 1.5 times as long as the previous one, up to a limit.
    """

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
    monkeypatch.setattr("omnibot_driver.reader.LONGEST_WAIT_S", 0.0)
    listener = Listener()
    link = link_to("/no/such/port", listener, session())
    link.start()
    listener.wait_for(lambda: len(listener.reports) > 40)  # without the limit this would take days
    link.close("stop")


def test_a_shorter_interval_ends_a_wait_that_was_longer(tmp_path: Path) -> None:
    """The port is missing, and the link waits for an hour before it tries to open it again.

    The interval is then reduced, so the link opens the port that has appeared meanwhile.
    """
    listener, ours = Listener(), session()
    name = tmp_path / "omnibot"
    link = link_to(str(name), listener, ours, reconnect_interval_s=3600.0)
    link.start()
    listener.wait_for(lambda: len(listener.reports) == 1)
    with PtyBoard(SimulatedBoard(), str(name)):
        link.reconnect_interval_s = 0.02
        listener.wait_for(lambda: ours.state == "nominal")
        link.close("stop")


def test_a_board_plugged_in_under_another_name_is_found_and_stands_still(tmp_path: Path) -> None:
    """A board that comes back under another device name is found by udev's symbolic link.

    The old command is not repeated.
    """
    name = tmp_path / "omnibot"
    listener, ours = Listener(), session()
    with PtyBoard(SimulatedBoard()) as second:
        with PtyBoard(SimulatedBoard(), str(name)) as first:
            link = link_to(str(name), listener, ours)
            link.start()
            listener.wait_for(lambda: ours.state == "nominal")
            link.call(lambda s, now: s.command_twist(BodyTwist(0.3, 0.0, 0.0), now))
            assert first.wait_for(lambda b: "velocity" in kinds(b), PATIENCE_S)
        listener.wait_for(lambda: ours.state == "disconnected")
        name.symlink_to(second.path)
        listener.wait_for(lambda: ours.state == "nominal")
        assert second.wait_for(lambda b: kinds(b)[-1:] == ["wheels"], PATIENCE_S)
        with second.lock:
            assert "velocity" not in kinds(second.board)
        link.call(lambda s, now: s.command_twist(BodyTwist(0.3, 0.0, 0.0), now))
        assert second.wait_for(lambda b: "velocity" in kinds(b), PATIENCE_S)
        link.close("stop")
        assert first.path != second.path


def test_an_unplugged_port_is_reported_and_ends_the_state(tmp_path: Path) -> None:
    """A board is unplugged. The link reports this, and its state is disconnected."""
    name, listener, ours = tmp_path / "omnibot", Listener(), session()
    with PtyBoard(SimulatedBoard(), str(name)):
        link = link_to(str(name), listener, ours)
        link.start()
        listener.wait_for(lambda: ours.state == "nominal")
    listener.wait_for(lambda: ours.state == "disconnected" and len(listener.reports) > 1)
    link.close("stop")
    assert "lost" in str(listener.reports[1])


def test_a_port_that_is_opened_while_the_link_is_closed_gets_the_last_stop_too() -> None:
    """The link begins to close while its port is still being opened.

    The link still writes a last Stop to this port, because the robot may follow an old command.
    """
    listener, started = Listener(), threading.Event()
    closer = threading.Thread(target=lambda: link.close("stop"))

    def close_first(_trouble: str | None) -> None:
        assert started.wait(PATIENCE_S)
        closer.start()
        wait_for_the_end_of("omnibot-pacer")

    listener.report = close_first  # type: ignore[method-assign]
    with PtyBoard(SimulatedBoard(BoardSettings(running=True))) as board:
        link = link_to(board.path, listener, session())
        link.start()
        started.set()
        assert board.wait_for(lambda b: bytes(b.received).endswith(STOP), PATIENCE_S)
        closer.join(PATIENCE_S)
        wait_for_the_end_of("omnibot-reader")


def test_a_robot_that_was_lost_while_it_drove_is_told_to_stop_at_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """If a lost port appears again while the driver ends, the driver sends Stop.

    No data confirms that the robot is at rest, so the driver does not report a standstill.
    """
    end_patiently(monkeypatch)
    name = tmp_path / "omnibot"
    listener, ours = Listener(), session()
    link = link_to(str(name), listener, ours)
    link.reconnect_interval_s = 3600.0
    with PtyBoard(SimulatedBoard(BoardSettings(running=True)), str(name)) as lost:
        link.start()
        listener.wait_for(lambda: ours.state == "nominal")
        link.call(lambda s, now: s.command_twist(BodyTwist(0.3, 0.0, 0.0), now))
        assert lost.wait_for(lambda b: "velocity" in kinds(b), PATIENCE_S)
    listener.wait_for(lambda: len(listener.reports) == 2)
    with PtyBoard(SimulatedBoard(BoardSettings(running=True)), str(name)) as board:
        assert link.close("stop")
        assert not link.unstopped
        assert not link.stands
        assert board.wait_for(lambda b: bytes(b.received).endswith(STOP), PATIENCE_S)
    wait_for_the_end_of("omnibot-reader")


def test_a_robot_that_was_lost_while_it_drove_is_known_not_to_be_stopped(tmp_path: Path) -> None:
    """The cable is unplugged during a drive, and the driver ends.

    The link reports that it could not stop the robot.
    """
    name, listener, ours = tmp_path / "omnibot", Listener(), session()
    with PtyBoard(SimulatedBoard(BoardSettings(running=True)), str(name)) as board:
        link = link_to(str(name), listener, ours)
        link.start()
        listener.wait_for(lambda: ours.state == "nominal")
        link.call(lambda s, now: s.command_twist(BodyTwist(0.3, 0.0, 0.0), now))
        assert board.wait_for(lambda b: "velocity" in kinds(b), PATIENCE_S)
    listener.wait_for(lambda: ours.state == "disconnected")
    for _ in range(2):
        assert not link.close("stop")
        assert link.unstopped
