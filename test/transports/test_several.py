# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Two serial lines as one transport, on real pseudo-terminals."""

import contextlib
import os
import threading
import tty
from collections.abc import Iterator
from functools import partial

import pytest
from terminal import fill

from omnibot_driver.core.errors import LinkError
from omnibot_driver.core.packets import Packet
from omnibot_driver.transports.serial_port import SerialPort
from omnibot_driver.transports.several import Several


class Ends:
    """The far ends of two lines."""

    def __init__(self) -> None:
        self.far, self.near, self.paths = [], [], []
        for _ in range(2):
            far, near = os.openpty()
            tty.setraw(near)
            self.far.append(far)
            self.near.append(near)
            self.paths.append(os.ttyname(near))

    def hang_up(self, number: int) -> None:
        for ends in (self.far, self.near):
            if ends[number] >= 0:
                os.close(ends[number])
                ends[number] = -1

    def close(self) -> None:
        self.hang_up(0)
        self.hang_up(1)


@pytest.fixture
def ends() -> Iterator[Ends]:
    ends = Ends()
    yield ends
    ends.close()


@pytest.fixture
def lines(ends: Ends) -> Iterator[Several]:
    lines = Several([partial(SerialPort, path, 115200) for path in ends.paths])
    yield lines
    lines.close()


def next_packets(lines: Several, count: int) -> set[Packet]:
    found: set[Packet] = set()
    while len(found) < count:
        packet = lines.read()
        if packet[1]:
            found.add(packet)
    return found


def test_what_is_read_and_written_keeps_its_channel(ends: Ends, lines: Several) -> None:
    """Both at once."""
    os.write(ends.far[0], b"drive")
    os.write(ends.far[1], b"front")
    assert next_packets(lines, 2) == {(0, b"drive"), (1, b"front")}
    lines.write(((1, b"a"), (0, b"b"), (1, b"c")))
    assert os.read(ends.far[0], 99) == b"b"
    assert os.read(ends.far[1], 99) == b"ac"


def test_a_line_that_is_lost_keeps_the_other_from_nothing(ends: Ends, lines: Several) -> None:
    """The stop still reaches the half that is there."""
    ends.hang_up(0)
    with pytest.raises(LinkError, match=f"lost {ends.paths[0]}"):
        lines.write(((0, b"stop"), (1, b"stop")))
    assert os.read(ends.far[1], 99) == b"stop"
    with pytest.raises(LinkError, match=f"lost {ends.paths[0]} while reading"):
        next_packets(lines, 1)


def test_a_line_that_takes_nothing_keeps_the_other_from_nothing(ends: Ends, lines: Several) -> None:
    """It is lost; the other was written to."""
    os.set_blocking(ends.near[0], False)
    fill(ends.near[0])
    with pytest.raises(LinkError, match="takes no more bytes"):
        lines.write(((0, b"stop"), (1, b"stop")))
    assert os.read(ends.far[1], 99) == b"stop"


def test_a_read_that_waits_can_be_ended(lines: Several) -> None:
    """And then nothing was read."""
    threading.Timer(0.02, lines.interrupt).start()
    assert lines.read() == (0, b"")


def test_where_one_cannot_be_opened_none_is_kept(ends: Ends) -> None:
    """The sentence is of the one that cannot; the other one is stopped."""
    before = len(os.listdir("/proc/self/fd"))
    paths = ends.paths[0], "/dev/no-such"
    with pytest.raises(LinkError, match="/dev/no-such does not exist"):
        Several([partial(SerialPort, path, 115200) for path in paths], ((0, b"stop"), (1, b"x")))
    assert os.read(ends.far[0], 99) == b"stop"
    assert len(os.listdir("/proc/self/fd")) == before
    with contextlib.closing(SerialPort(ends.paths[0], 115200)):
        pass


def test_the_same_port_twice_is_refused(ends: Ends) -> None:
    """Ports are exclusive."""
    with pytest.raises(LinkError, match="in use"):
        Several([partial(SerialPort, ends.paths[0], 115200)] * 2)
