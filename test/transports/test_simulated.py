# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A simulated board in the driver's own process, as a transport."""

import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing

import pytest
import toy_lines
from toy_udp import ToyServer

from omnibot_driver.core.errors import LinkError
from omnibot_driver.simulator.common.running import UNREAD_LIMIT
from omnibot_driver.simulator.omnibot import BoardSettings, SimulatedBoard
from omnibot_driver.transports.simulated import (
    UNREAD_DATAGRAMS,
    InProcessBoard,
    SimulatedTransport,
)

pytestmark = pytest.mark.usefixtures("nothing_left_behind")

OMNIBOT = "omnibot_driver.simulator.omnibot"
PATIENCE_S = 20.0


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    """Whatever a test enters here ends with it."""
    with ExitStack() as stack:
        yield stack


def read(transport: SimulatedTransport, wanted: int, channel: int = 0) -> bytes:
    """So many bytes of a channel at least, that of others aside."""
    data, deadline_s = b"", time.monotonic() + PATIENCE_S
    while len(data) < wanted:
        assert time.monotonic() < deadline_s, f"only {data!r} came"
        number, part = transport.read()
        data += part if number == channel else b""
    return data


def test_a_board_boots_and_obeys(stack: ExitStack) -> None:
    """It says that it is paused, and sends data once it is woken and started."""
    transport = stack.enter_context(closing(SimulatedTransport("sim://", OMNIBOT)))
    assert read(transport, 11) == b"Paused: 0 \n"
    transport.write([(0, bytes(8)), (0, b"S")])
    assert read(transport, 2)[:2] == b"\xff\xfa"


def test_it_needs_no_guard_and_no_kernel() -> None:
    """It ends with this process, has no descriptors, and counts no overruns."""
    with closing(SimulatedTransport("sim://", OMNIBOT)) as transport:
        assert transport.ends_with_us
        assert (transport.descriptors, transport.overruns) == (None, None)


def test_a_read_ends_without_a_packet() -> None:
    """When its time is over."""
    assert InProcessBoard(SimulatedBoard()).read(0.01) == (0, b"")


def test_a_read_that_waits_can_be_interrupted() -> None:
    """Closing a driver does not wait for the next notice of a paused board."""
    board = InProcessBoard(SimulatedBoard())
    canceller = threading.Timer(0.02, board.cancel)
    canceller.start()
    assert board.read(PATIENCE_S) == (0, b"")
    canceller.join()
    board.cancel()
    assert board.read(PATIENCE_S) == (0, b""), "and so is the next one, if none waits"


def test_after_closing_nothing_is_read_and_nothing_written() -> None:
    """As with a port that is gone; closing again is harmless."""
    transport = SimulatedTransport("sim://", OMNIBOT)
    transport.close()
    transport.close()
    transport.interrupt()
    with pytest.raises(LinkError, match="lost sim:// while reading: it is closed"):
        transport.read()
    with pytest.raises(LinkError, match="lost sim:// while writing: it is closed"):
        transport.write([(0, b"S")])


@pytest.mark.parametrize(
    ("url", "why"),
    [
        ("sim://?wheels=4", "there is no option 'wheels=4'"),
        ("sim://?imu", "there is no option 'imu'"),
        ("sim://?lose=2", "'2' is no probability: give a number from 0 to 1"),
        ("sim://?seed=first", "invalid int value: 'first'"),
        ("sim://?imu_only=maybe", "--imu-only: ignored explicit argument 'maybe'"),
        ("sim://imu_only", "'imu_only' must come after a question mark"),
    ],
)
def test_options_that_it_does_not_know_are_refused(url: str, why: str) -> None:
    """By a sentence that names the option, the whole list and an example."""
    with pytest.raises(LinkError) as refusal:
        SimulatedTransport(url, OMNIBOT)
    assert why in str(refusal.value)
    assert "simulator --help" in str(refusal.value)


def test_the_options_of_another_board_are_asked_of_that_board() -> None:
    """The sentence names the command line that lists them."""
    with pytest.raises(LinkError, match="simulator --board toy_lines --help"):
        SimulatedTransport("sim://?imu_only", "toy_lines")


def test_bytes_that_nobody_reads_are_dropped_and_counted() -> None:
    """It keeps what a terminal would, and the oldest of it."""
    served = InProcessBoard(SimulatedBoard(BoardSettings(running=True)))
    sent = b""
    while not served.dropped:
        data = served.board.step()
        sent += data
        served.dropped += len(data) - served._send(0, data)
    assert served.unread() == UNREAD_LIMIT
    assert served.read(0) == (0, sent[:UNREAD_LIMIT])


def test_datagrams_that_nobody_reads_are_dropped_whole() -> None:
    """It keeps as many as a socket would, apart from each other, an empty one too."""
    served = InProcessBoard(ToyServer())
    taken = [served._send(0, data) for data in [b"", *[b"ok 1"] * UNREAD_DATAGRAMS]]
    assert taken == [0, *[4] * (UNREAD_DATAGRAMS - 1), 0]
    assert [served.read(0) for _ in range(3)] == [(0, b""), (0, b"ok 1"), (0, b"ok 1")]


def test_channels_are_told_apart_in_the_order_of_the_board(stack: ExitStack) -> None:
    """What came on another channel in between is not joined."""
    transport = stack.enter_context(closing(SimulatedTransport("sim://", "toy_lines")))
    transport.write([(toy_lines.FRONT, b"angle 30\n"), (toy_lines.DRIVE, b"go 0.5 0\n")])
    assert b"30" in read(transport, 200, toy_lines.FRONT)
    assert b"odo" in read(transport, 10, toy_lines.DRIVE)


def test_a_board_whose_thread_died_is_a_defect(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is raised with its cause, and not taken for a lost cable."""

    def explode(_board: SimulatedBoard) -> bytes:
        raise ZeroDivisionError

    monkeypatch.setattr(SimulatedBoard, "step", explode)
    transport = SimulatedTransport("sim://", OMNIBOT)
    with pytest.raises(RuntimeError, match="thread died") as defect:
        read(transport, 1)
    assert isinstance(defect.value.__cause__, ZeroDivisionError)
    with pytest.raises(RuntimeError, match="thread died"):
        transport.close()
