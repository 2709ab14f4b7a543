# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of a link to a board with two lines, of which one appears late, is lost or comes back."""

import os
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from pathlib import Path

import pytest
from listener import PATIENCE_S, Listener
from terminal import Terminal
from toys.line_board import STOP, LineBoard
from toys.line_robot import LineRobot

from omnibot_driver.core.commands.limits import SpeedLimits
from omnibot_driver.core.commands.policy import CommandSettings
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.odometry.estimate import OdometryEstimate, OdometrySettings
from omnibot_driver.core.packets import Packets, joined, packed
from omnibot_driver.core.session import Session, SessionSettings
from omnibot_driver.link import Link
from omnibot_driver.simulator.common.serving import ServedBoard
from omnibot_driver.transports.serial_port import SerialPort
from omnibot_driver.transports.several import Several

pytestmark = pytest.mark.usefixtures("nothing_left_behind")
STOPS = joined(STOP)


OTHER_STOP = packed(b"v  0  0\n")


class MoodyBoard(LineBoard):
    """A board whose stop command depends on its last report."""

    def stop(self) -> Packets:
        return OTHER_STOP if self.mode.running else STOP


def session_of(board: LineBoard) -> Session:
    settings = SessionSettings(
        limits=SpeedLimits(), commands=CommandSettings(), odometry=OdometrySettings()
    )
    return Session(board, settings, run=False)


def link_of(session: Session, openers: list[partial[SerialPort]], listener: Listener) -> Link:
    return Link(
        session,
        lambda: Several([(each.args[0], each) for each in openers], retry_s=0.01),
        "two lines",
        guard=True,
        reconnect_interval_s=0.02,
        deliver=listener.deliver,
        report=listener.report,
        failed=listener.failed,
    )


def command(link: Link) -> None:
    link.command(
        lambda session, twist, now: session.command_twist(twist, now),
        BodyTwist(0.2, 0.0, 0.0),
        (),
    )


class Lines:
    """Pseudo-terminals in place of a board with two lines, and a link to them."""

    def __init__(self, folder: Path, board: LineBoard | None = None) -> None:
        self.drive, self.sense = Terminal(), Terminal()
        self.name = folder / "sense"
        self.listener = Listener()
        self.session = session_of(board or LineBoard())
        paths = (self.drive.path, str(self.name))
        self.openers = [partial(SerialPort, path, 115200) for path in paths]
        self.link = link_of(self.session, self.openers, self.listener)

    def connect(self) -> None:
        self.name.symlink_to(self.sense.path)

    def say_that_it_stands(self) -> None:
        """Wait until the line is open. Then write a report of a standstill, as the board would.

        Data that is sent earlier would be lost.
        """
        self.listener.wait_for(lambda: self.listener.reports[-1:] == [None])
        os.write(self.sense.far, b"d 0 0\n")
        self.come_to_state("nominal")

    @property
    def estimates(self) -> list[OdometryEstimate]:
        return [event for event in self.listener.events if isinstance(event, OdometryEstimate)]

    def come_to_state(self, state: str) -> None:
        self.listener.wait_for(
            lambda: state in [getattr(event, "state", None) for event in self.listener.events]
        )
        self.listener.events.clear()
        assert self.session.state == state

    def close(self) -> None:
        self.link.close("stop")
        for terminal in (self.drive, self.sense):
            terminal.close()


@pytest.fixture
def lines(tmp_path: Path) -> Iterator[Lines]:
    with closing(Lines(tmp_path)) as lines:
        yield lines


def test_a_line_that_is_there_hears_stop_again_and_again_while_another_is_missing(
    lines: Lines,
) -> None:
    """One of two lines is missing. The link repeats Stop on the other line.

    Motion is refused, and the error names the missing line.
    """
    lines.link.start()
    lines.drive.read_until(5 * STOPS)
    lines.come_to_state("connecting")
    with pytest.raises(CommandRefused, match="the port 'sense' is missing"):
        command(lines.link)
    (report,) = lines.listener.reports
    assert str(report).startswith(f"the port 'sense' is missing: {lines.name} does not exist")
    assert lines.link.figures()[0].trouble == report
    answer = lines.link.call(lambda session, now: session.estop(True, now))
    assert answer.endswith(
        "the port 'sense' is missing: the driver sends the stop on the other ports only; cut the"
        " motor power if the robot moves"
    )
    lines.drive.read_until(20 * STOPS)


def test_a_line_that_comes_late_completes_the_board(lines: Lines) -> None:
    """The second line appears later than the first. When both are open, the robot can be driven."""
    lines.link.start()
    lines.drive.read_until(STOPS)
    lines.connect()
    lines.say_that_it_stands()
    command(lines.link)
    lines.drive.read_until(b"v 200 200\n")


def test_a_line_that_is_lost_stops_the_robot_and_its_return_does_not_move_it(
    lines: Lines,
) -> None:
    """One line disappears while the robot drives, and the link stops the robot.

    When the line is back, the link does not repeat the command.
    """
    lines.connect()
    lines.link.start()
    lines.say_that_it_stands()
    command(lines.link)
    lines.drive.read_until(b"v 200 200\n")
    lines.name.unlink()
    lines.sense.close()
    lines.drive.read_until(5 * STOPS)
    lines.come_to_state("connecting")
    lines.sense = Terminal()
    lines.connect()
    lines.say_that_it_stands()
    assert b"v 2" not in lines.drive.read_until(5 * STOPS)


def test_an_overrun_is_counted_once_although_another_line_is_lost_and_comes_back(
    lines: Lines, monkeypatch: pytest.MonkeyPatch
) -> None:
    """When a lost line is opened again, the total number of overruns of all lines is unchanged."""
    overruns = {lines.drive.path: 5, str(lines.name): 3}
    monkeypatch.setattr(SerialPort, "overruns", property(lambda port: overruns[port._url]))
    monkeypatch.setattr("omnibot_driver.reader.COUNT_EVERY_S", 0.0)
    told: list[int] = []
    lines.session.overran = told.append  # type: ignore[method-assign]
    lines.connect()
    lines.link.start()
    lines.say_that_it_stands()
    assert set(told) == {8}
    lines.name.unlink()
    lines.sense.close()
    lines.come_to_state("connecting")
    overruns[str(lines.name)] = 0
    lines.sense = Terminal()
    lines.connect()
    lines.say_that_it_stands()
    assert set(told) == {8}
    assert lines.link.figures()[0].overruns == 8


def test_a_robot_without_its_drive_is_not_driven(lines: Lines) -> None:
    """The line ``drive`` of a board is missing, so motion is refused.

    The measurements from the other line, ``sense``, still arrive.
    """
    lines.connect()
    missing = lines.openers[0] = partial(SerialPort, str(lines.name) + "-not", 115200)
    lines.link.start()
    lines.listener.wait_for(lambda: lines.listener.reports)
    os.write(lines.sense.far, b"d 0 0\n")
    lines.listener.wait_for(lambda: lines.estimates)
    assert lines.session.state == "connecting"
    with pytest.raises(CommandRefused, match="the port 'drive' is missing"):
        command(lines.link)
    assert missing.args[0] in str(lines.listener.reports)


def test_the_guard_knows_what_stops_the_board_as_it_is_now(tmp_path: Path) -> None:
    """When the board's state changes, the guard process gets the bytes that now stop the board."""
    with closing(Lines(tmp_path, MoodyBoard())) as lines:
        lines.connect()
        lines.link.start()
        lines.drive.read_until(STOPS)
        keeper = lines.link._shared.keeper
        assert keeper is not None
        assert keeper.last_words == (STOP, STOP)
        lines.say_that_it_stands()
        lines.drive.read_until(joined(OTHER_STOP))
        assert keeper.last_words == (OTHER_STOP, OTHER_STOP)


def ends_at_rest() -> bool:
    """Close the link of a driving robot, and return whether odometry showed the robot at rest."""
    with ServedBoard(LineRobot()) as robot:
        lines = [partial(SerialPort, path, 115200) for path in robot.addresses]
        listener, ours = Listener(), session_of(LineBoard())
        link = link_of(ours, lines, listener)
        link.start()
        listener.wait_for(lambda: ours.state == "nominal")
        command(link)
        assert robot.wait_for(lambda board: not board.stands, PATIENCE_S)
        return link.close("stop") and link.stands


def test_an_end_waits_until_slow_odometry_shows_that_the_robot_stands() -> None:
    """A link closes while the robot drives. The close waits until odometry proves a standstill.

    Odometry comes every 0.4 s, or later on a busy computer.
    """
    assert any(ends_at_rest() for _ in range(5))
