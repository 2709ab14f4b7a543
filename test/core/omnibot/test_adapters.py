# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that an IMU frame is returned as soon as the packet with its last byte arrives.

The last byte may look like the beginning of the next frame. The decoder then decides by the arrival
times to which frame the byte belongs.
"""

from collections.abc import Callable, Iterator
from itertools import islice
from random import Random

import pytest

from omnibot_driver.core.omnibot import OmniBot, OmniBotSettings
from omnibot_driver.core.omnibot.decoder import FrameDecoder
from omnibot_driver.core.omnibot.gaps import BYTE_S
from omnibot_driver.core.readings import ImuReading
from omnibot_driver.simulator.omnibot import BoardSettings, SimulatedBoard

TICKS = 1200
SETTLED = 300
"""Number of readings after which the decoder has learned in which pieces the adapter sends."""
IMU_LENGTH = 14
DRIFT = 1.0002
"""Real period of the adapter's timer by the board's clock, divided by its nominal period.

The quotient is not 1, so packets end at all phases of a tick.
"""

Handed = Iterator[tuple[float, bytes]]


def ticks() -> Iterator[tuple[float, bytes]]:
    """Yield the time in s and the bytes of each tick of a robot at rest.

    The gyro often gives -1, whose bytes look like a header.
    """
    board = SimulatedBoard(BoardSettings(seed=1, running=True))
    for tick in range(TICKS):
        yield tick * 0.01, board.step()


def pieces() -> Handed:
    """Yield the bytes in pieces of 1 to 16 bytes, each when its last byte has arrived."""
    random = Random(1)
    for at, data in ticks():
        start = 0
        while start < len(data):
            end = min(len(data), start + random.randint(1, 16))
            yield at + end * BYTE_S, data[start:end]
            start = end


def behind_timer(timer_s: float) -> Handed:
    """Yield all bytes that the adapter holds, each time its latency timer runs out."""
    held, out = b"", 0.0
    for at, data in ticks():
        for number in range(len(data)):
            arrived = at + (number + 1) * BYTE_S
            while out < arrived:
                if held:
                    yield out, held
                held, out = b"", out + timer_s * DRIFT
            held += data[number : number + 1]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("adapter", "waits"),
    [(pieces, 0.01), (lambda: behind_timer(0.001), 0.01), (lambda: behind_timer(0.016), 0.005)],
    ids=["pieces", "1 ms timer", "16 ms timer"],
)
def test_hardly_a_frame_waits_for_the_next_packet(
    adapter: Callable[[], Handed], waits: float
) -> None:
    """Hardly any IMU frame must wait until the adapter delivers its next packet.

    A frame waits only if a delta may follow it, or if the adapter splits the frame.
    """
    board = OmniBot(OmniBotSettings())
    ends: list[int] = []
    sent = 0
    for _, data in ticks():
        ends.append(sent + IMU_LENGTH)
        sent += len(data)
    handed = heard = late = 0
    for now, data in adapter():
        before, handed = handed, handed + len(data)
        for reading in board.receive(data, now):
            if isinstance(reading, ImuReading):
                late += heard >= SETTLED and ends[heard] <= before
                heard += 1
    assert heard > TICKS - 10
    assert late <= waits * (heard - SETTLED)
    assert board.figures.discarded_bytes == 0


def test_an_empty_read_changes_nothing() -> None:
    """Two decoders get the same reads, and one of them also gets an empty read after each.

    Both return the same readings.
    """
    one, other = OmniBot(OmniBotSettings()), OmniBot(OmniBotSettings())
    for now, data in islice(pieces(), TICKS):
        assert one.receive(data, now) == other.receive(data, now)
        assert other.receive(b"", now + BYTE_S / 2) == []


def test_a_line_that_lost_a_byte_is_not_calm_for_ten_seconds() -> None:
    """For ten seconds after a lost byte, the decoder does not regard the line as calm.

    In this time, it needs more evidence before it accepts a frame.
    """
    decoder = FrameDecoder()
    lost_s, calm = 1.0, {}
    for at, data in ticks():
        decoder.feed(data[1:] if at == lost_s else data, at)
        calm[at] = decoder.calm
    assert calm[lost_s - 0.01]
    assert not any(value for at, value in calm.items() if lost_s + 0.1 < at < lost_s + 9.9)
    assert calm[(TICKS - 1) * 0.01]
