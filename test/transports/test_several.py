# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of two serial lines as one transport, on real pseudo-terminals."""

import contextlib
import os
import select
import threading
import time
import tty
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import NoReturn

import pytest
from terminal import fill

from omnibot_driver.core.errors import LinkError
from omnibot_driver.core.packets import Packet
from omnibot_driver.transports import LinesChanged
from omnibot_driver.transports.serial_port import SerialPort
from omnibot_driver.transports.several import Opener, Several

PATIENCE_S = 10.0


class Ends:
    """The ends of two lines: ``far`` has the boards' ends, ``near`` has the driver's ends.

    ``paths``: symbolic links to the driver's ends. The link of a lost line is removed.
    """

    def __init__(self, folder: Path) -> None:
        self.far, self.near, self.paths = [], [], []
        for number in range(2):
            far, near = os.openpty()
            tty.setraw(near)
            self.far.append(far)
            self.near.append(near)
            link = folder / str(number)
            link.symlink_to(os.ttyname(near))
            self.paths.append(str(link))

    def hang_up(self, number: int) -> None:
        # Another program may get a terminal with the same name.
        Path(self.paths[number]).unlink(missing_ok=True)
        for ends in (self.far, self.near):
            if ends[number] >= 0:
                os.close(ends[number])
                ends[number] = -1

    def close(self) -> None:
        self.hang_up(0)
        self.hang_up(1)


def port(path: str) -> tuple[str, Opener]:
    return path, partial(SerialPort, path, 115200)


@pytest.fixture
def ends(tmp_path: Path) -> Iterator[Ends]:
    ends = Ends(tmp_path)
    yield ends
    ends.close()


@pytest.fixture
def lines(ends: Ends) -> Iterator[Several]:
    lines = Several([port(path) for path in ends.paths])
    yield lines
    lines.close()


def heard(far: int, words: bytes) -> bytes:
    """Read until the received bytes end with ``words``, and return all of them."""
    came = b""
    while not came.endswith(words):
        came += os.read(far, 4096)
    return came


def next_packets(lines: Several, count: int) -> set[Packet]:
    found: set[Packet] = set()
    while len(found) < count:
        packet = lines.read()
        if packet[1]:
            found.add(packet)
    return found


def test_what_is_read_and_written_keeps_its_channel(ends: Ends, lines: Several) -> None:
    """Both lines are used at the same time. All bytes keep their channel, in both directions."""
    os.write(ends.far[0], b"drive")
    os.write(ends.far[1], b"front")
    assert next_packets(lines, 2) == {(0, b"drive"), (1, b"front")}
    lines.write(((1, b"a"), (0, b"b"), (1, b"c")))
    assert heard(ends.far[0], b"b") == b"b"
    assert heard(ends.far[1], b"ac") == b"ac"


def read_on(lines: Several) -> NoReturn:
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until:
        lines.read()
    pytest.fail(f"the lines could be read for {PATIENCE_S:g} s, without an exception")


def changed(lines: Several) -> dict[int, str]:
    """Read until the set of missing lines changes, and return these lines, each with the reason."""
    with pytest.raises(LinesChanged):
        read_on(lines)
    return dict(lines.missing)


def test_a_line_that_is_lost_keeps_the_other_from_nothing(ends: Ends, lines: Several) -> None:
    """One of two lines is lost. The remaining line still carries stops and data."""
    ends.hang_up(0)
    lines.write(((0, b"stop"), (1, b"stop")))
    assert os.read(ends.far[1], 99) == b"stop"
    assert f"lost {ends.paths[0]} while reading" in changed(lines)[0]
    os.write(ends.far[1], b"front")
    assert next_packets(lines, 1) == {(1, b"front")}
    assert lines.descriptors is not None
    assert lines.descriptors[0] is None


def test_where_no_line_is_left_all_are_lost(ends: Ends, lines: Several) -> None:
    """Both lines are lost, one after the other.

    LinkError says why the first line was lost.
    """
    ends.hang_up(0)
    changed(lines)
    ends.hang_up(1)
    with pytest.raises(LinkError, match=f"lost {ends.paths[0]}|does not exist"):
        read_on(lines)


def test_a_line_that_is_full_does_not_delay_the_others(ends: Ends, lines: Several) -> None:
    """A write does not wait for a full line, and the other line gets its data at once.

    After 0.2 s, the full line is reported as missing, and its old data is discarded.
    """
    os.set_blocking(ends.near[0], False)
    fill(ends.near[0])
    poll = select.poll

    def at_once(*_: object) -> NoReturn:
        pytest.fail("the write waits")

    select.poll = at_once  # type: ignore[misc,assignment]
    try:
        lines.write(((0, b"old"), (1, b"stop")))
        lines.write(((0, b"old"), (1, b"stop")))
    finally:
        select.poll = poll  # type: ignore[misc]
    assert heard(ends.far[1], b"stopstop") == b"stopstop"
    assert changed(lines) == {0: "it has not accepted all data within 0.2 s"}
    lines.write(((0, b"new"), (1, b"stop")))
    assert heard(ends.far[0], b"new").strip(b"x") == b"new"


def test_a_line_is_missing_as_soon_as_a_write_finds_it_full_for_too_long(
    ends: Ends, lines: Several, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A line accepts no data for too long. The next write declares it missing.

    The line is missing at once, even if no read follows.
    """
    os.set_blocking(ends.near[0], False)
    fill(ends.near[0])
    monkeypatch.setattr("omnibot_driver.transports.line.WRITE_TIMEOUT_S", 0.0)
    lines.write(((0, b"old"),))
    assert list(lines.missing) == [0]
    assert list(changed(lines)) == [0]


def test_a_full_line_is_not_shared_so_that_it_can_be_opened_again(
    ends: Ends, lines: Several, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The driver does not share a line with the guard if the line accepts no more data.

    The driver must close and reopen this line, but the guard's copy would keep the port locked.
    """
    os.set_blocking(ends.near[0], False)
    fill(ends.near[0])
    monkeypatch.setattr("omnibot_driver.transports.line.WRITE_TIMEOUT_S", 0.0)
    lines.write(((0, b"old"),))
    assert lines.descriptors is not None
    assert [one is None for one in lines.descriptors] == [True, False]


def test_what_a_full_line_does_not_take_at_once_follows_in_order(
    ends: Ends, lines: Several, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A line is full. The data of two writes follows in order as soon as the other end reads."""
    monkeypatch.setattr("omnibot_driver.transports.line.WRITE_TIMEOUT_S", 60.0)
    os.set_blocking(ends.near[0], False)
    fill(ends.near[0])
    lines.write(((0, b"one"),))
    lines.write(((0, b"two"),))
    reader = threading.Thread(target=heard, args=(ends.far[0], b"onetwo"))
    reader.start()
    while reader.is_alive():
        assert lines.read() == (0, b"")
    assert lines.missing == {}


def test_a_line_that_comes_back_is_opened_while_the_others_stay_open(
    ends: Ends, tmp_path: Path
) -> None:
    """A missing line appears. It is opened, and the other line stays open."""
    late = tmp_path / "late"
    paths = str(late), ends.paths[1]
    lines = Several([port(path) for path in paths], retry_s=0.01)
    with contextlib.closing(lines):
        assert lines.descriptors is not None
        there = lines.descriptors[1]
        assert "late does not exist" in lines.missing[0]
        late.symlink_to(ends.paths[0])
        assert changed(lines) == {}
        assert lines.descriptors[1] == there
        os.write(ends.far[0], b"drive")
        assert next_packets(lines, 1) == {(0, b"drive")}
        ends.hang_up(0)
        assert 0 in changed(lines)


def test_a_read_that_waits_can_be_ended(lines: Several) -> None:
    """A read waits for data, and another thread ends it. The read returns without data."""
    threading.Timer(0.02, lines.interrupt).start()
    assert lines.read() == (0, b"")


def test_where_none_can_be_opened_none_is_kept() -> None:
    """No line can be opened. The error gives the reason for the first line.

    No file descriptor stays open.
    """
    before = len(os.listdir("/proc/self/fd"))
    paths = "/dev/no-such", "/dev/no-such-either"
    with pytest.raises(LinkError, match="/dev/no-such does not exist"):
        Several([port(path) for path in paths])
    assert len(os.listdir("/proc/self/fd")) == before


def test_the_same_port_twice_is_missing_once(ends: Ends) -> None:
    """Both lines have the same port. The first line opens it, and the second line is missing.

    The reason: a port is exclusive, so it cannot be opened twice.
    """
    with contextlib.closing(Several([port(ends.paths[0])] * 2)) as lines:
        assert "in use" in lines.missing[1]


@pytest.mark.parametrize("ours", [(0, 1), (1, 0)])
@pytest.mark.parametrize("theirs", [(0, 1), (1, 0)])
def test_of_two_drivers_that_wait_for_the_same_lines_one_gets_both(
    ours: tuple[int, int], theirs: tuple[int, int], ends: Ends, tmp_path: Path
) -> None:
    """Two drivers wait for the same two lines, and each driver has opened one of the lines.

    Both lines go to the driver with the *leading* line, whose device path is the first in
    alphabetical order.
    """
    leading, other = sorted(ends.paths, key=os.path.realpath)
    late = tmp_path / "late"
    paths = str(late), other
    with contextlib.closing(Several([port(paths[i]) for i in ours], retry_s=0.01)) as second:
        assert list(second.missing) == [ours.index(0)]
        late.symlink_to(os.path.realpath(leading))
        with contextlib.closing(Several([port(paths[i]) for i in theirs], retry_s=0.01)) as first:
            assert "in use" in first.missing[theirs.index(1)]
            with pytest.raises(LinkError, match="late is in use"):
                read_on(second)
            second.close()
            assert changed(first) == {}
            with pytest.raises(LinkError, match="late is in use"):
                Several([port(paths[i]) for i in ours])


def test_a_program_that_takes_the_lost_first_line_does_not_cost_the_second(
    ends: Ends, lines: Several
) -> None:
    """The first line is lost during a drive, and another program opens it when it comes back.

    The second line stays open, because the robot may have to be stopped through it.
    """
    ends.hang_up(0)
    assert list(changed(lines)) == [0]
    ends.far[0], ends.near[0] = os.openpty()
    Path(ends.paths[0]).symlink_to(os.ttyname(ends.near[0]))
    with contextlib.closing(SerialPort(ends.paths[0], 115200)):
        while "in use" not in lines.missing[0]:
            lines.read()
        assert list(lines.missing) == [0]
    assert changed(lines) == {}


def test_a_port_that_cannot_be_waited_for_is_none_of_several() -> None:
    """A port without a file descriptor cannot be one of several lines: LinkError is raised."""
    with pytest.raises(LinkError, match="does not work for a board with several ports"):
        Several([port("loop://")])
