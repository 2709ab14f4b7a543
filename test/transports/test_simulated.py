# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the transport to a simulated board that runs in the driver's own process."""

import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing

import pytest
import toy_lines
from toy_udp import ToyServer

from omnibot_driver.core.errors import LinkError, ParameterError
from omnibot_driver.simulator.common.running import UNREAD_LIMIT
from omnibot_driver.transports.simulated import (
    UNREAD_DATAGRAMS,
    InProcessBoard,
    SimulatedTransport,
    check_address,
)

pytestmark = pytest.mark.usefixtures("nothing_left_behind")

TOY = "toy_lines"
PATIENCE_S = 60.0


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


def read(transport: SimulatedTransport, wanted: int, channel: int = 0) -> bytes:
    """Read until ``wanted`` bytes of one channel have come. Discard the bytes of other channels."""
    data, deadline_s = b"", time.monotonic() + PATIENCE_S
    while len(data) < wanted:
        assert time.monotonic() < deadline_s, f"only {data!r} came"
        number, part = transport.read()
        data += part if number == channel else b""
    return data


def test_it_needs_no_guard_and_no_kernel() -> None:
    """A simulated board ends with the driver's process, so it needs no guard.

    Its transport has no file descriptors, and does not count overruns.
    """
    with closing(SimulatedTransport("sim://", TOY)) as transport:
        assert transport.ends_with_us
        assert (transport.descriptors, transport.overruns) == (None, None)


def test_a_read_ends_without_a_packet() -> None:
    """The board sends nothing. A read ends after its time limit."""
    assert InProcessBoard(ToyServer()).read(0.01) == (0, b"")


def test_a_read_that_waits_can_be_interrupted() -> None:
    """A read that waits for data returns without data if another thread interrupts it."""
    board = InProcessBoard(ToyServer())
    canceller = threading.Timer(0.02, board.cancel)
    canceller.start()
    assert board.read(PATIENCE_S) == (0, b"")
    canceller.join()
    board.cancel()
    assert board.read(PATIENCE_S) == (0, b""), "if no read waits, ``cancel`` ends the next read"


def test_after_closing_nothing_is_read_and_nothing_written() -> None:
    """A closed transport raises LinkError, like a lost port. Closing it again does nothing."""
    transport = SimulatedTransport("sim://", TOY)
    transport.close()
    transport.close()
    transport.interrupt()
    with pytest.raises(LinkError, match="lost sim:// while reading: the driver has closed it"):
        transport.read()
    with pytest.raises(LinkError, match="lost sim:// while writing: the driver has closed it"):
        transport.write([(0, b"S")])


def test_bytes_that_nobody_reads_are_dropped_and_counted() -> None:
    """The driver does not read. A channel keeps as many bytes as a terminal would.

    Later bytes of this channel are dropped and counted. The other channel still accepts bytes.
    """

    class Talking(toy_lines.ToyLines):
        def advance(self) -> list[tuple[int, bytes]]:
            self.tick += 1
            return [(toy_lines.FRONT, bytes([self.tick]) * 1000)]

    served = InProcessBoard(Talking())
    dropped = []
    for _ in range(6):
        served._let_pass(1)
        dropped.append(served.dropped)
    assert dropped == [0, 0, 0, 0, 5000 - UNREAD_LIMIT, 6000 - UNREAD_LIMIT]
    assert served._send(toy_lines.DRIVE, b"odo") == 3
    assert served.unread(toy_lines.FRONT) == UNREAD_LIMIT
    channel, data = served.read(0)
    assert (channel, len(data), data[-1]) == (toy_lines.FRONT, UNREAD_LIMIT, 5)


def test_datagrams_that_nobody_reads_are_dropped_whole() -> None:
    """The driver does not read. A channel keeps as many whole datagrams as a socket would.

    Empty datagrams count, too. Later datagrams are dropped.
    """
    served = InProcessBoard(ToyServer())
    taken = [served._send(0, data) for data in [b"", *[b"ok 1"] * UNREAD_DATAGRAMS]]
    assert taken == [0, *[4] * (UNREAD_DATAGRAMS - 1), 0]
    assert [served.read(0) for _ in range(3)] == [(0, b""), (0, b"ok 1"), (0, b"ok 1")]


def test_channels_are_told_apart_in_the_order_of_the_board(stack: ExitStack) -> None:
    """A read returns bytes of one channel only.

    Successive reads return the bytes in the order in which the board has sent them.
    """
    transport = stack.enter_context(closing(SimulatedTransport("sim://", TOY)))
    transport.write([(toy_lines.FRONT, b"angle 30\n"), (toy_lines.DRIVE, b"go 0.5 0\n")])
    assert b"30" in read(transport, 200, toy_lines.FRONT)
    assert b"odo" in read(transport, 10, toy_lines.DRIVE)


@pytest.mark.parametrize(
    ("url", "why"),
    [
        ("sim://?imu_only", "there is no option 'imu-only'"),
        ("sim://?ang=30", "there is no option 'ang=30'"),
        ("sim://?angle=wide", "invalid float value: 'wide'"),
        ("sim://?lose=2", "'2' is not a probability; give a number from 0 to 1"),
        ("sim://angle", "'angle' must come after a question mark"),
    ],
)
def test_options_that_this_board_does_not_know_are_refused(url: str, why: str) -> None:
    """A URL has a wrong option.

    The message says what is wrong, and names the command that lists the options.
    """
    with pytest.raises(ParameterError) as refusal:
        check_address(url, TOY)
    assert f"port '{url}' is not valid: " in str(refusal.value)
    assert why in str(refusal.value)
    assert "simulator --board toy_lines --help" in str(refusal.value)


def test_a_board_whose_thread_died_is_a_defect(monkeypatch: pytest.MonkeyPatch) -> None:
    """If the board's thread fails, a read and the close raise RuntimeError.

    The error of the read has the thread's exception as its cause. It is not the error of a lost
    line.
    """

    def explode(_board: toy_lines.ToyLines) -> list[tuple[int, bytes]]:
        raise ZeroDivisionError

    monkeypatch.setattr(toy_lines.ToyLines, "advance", explode)
    transport = SimulatedTransport("sim://", TOY)
    with pytest.raises(RuntimeError, match="thread died") as defect:
        read(transport, 1)
    assert isinstance(defect.value.__cause__, ZeroDivisionError)
    with pytest.raises(RuntimeError, match="thread died"):
        transport.close()
