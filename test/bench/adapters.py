# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Models of how a USB adapter delivers the bytes of a line.

An adapter delivers all bytes of a board's tick at once, or pieces of up to 16 bytes, or packets of
62 bytes that a timer can end early. The delivery does not depend on the frames. All times are in s.
"""

from collections.abc import Callable, Iterator
from random import Random
from typing import Final

BYTE_S: Final = 10 / 115200
LARGEST_PIECE: Final = 16
PACKET: Final = 62
"""Size of an FTDI packet in bytes."""
DRIFT: Final = 1.0002
"""Real period of the adapter's timer, divided by its nominal period.

Because of the difference, packets end at every position in the board's tick.
"""

Handed = tuple[float, bytes]
"""Time of a delivery in s, and the delivered bytes."""
Ticks = Iterator[tuple[float, bytes]]
Adapter = Callable[[Ticks, Random], Iterator[Handed]]


def whole(ticks: Ticks, _random: Random) -> Iterator[Handed]:
    """Deliver all bytes of a tick at its beginning. No real adapter can deliver them this early."""
    yield from ticks


def pieces(ticks: Ticks, random: Random) -> Iterator[Handed]:
    """Deliver 1 to 16 bytes at a time, at the line's pace, as CDC, CH340 and CP210x adapters do."""
    for at, data in ticks:
        start = 0
        while start < len(data):
            end = min(len(data), start + random.randint(1, LARGEST_PIECE))
            yield at + end * BYTE_S, data[start:end]
            start = end


def packets(timer_s: float) -> Adapter:
    """Make an adapter like those of FTDI, with a latency timer of ``timer_s``.

    A packet has 62 bytes, or fewer when the timer runs out.
    """

    def handed(ticks: Ticks, random: Random) -> Iterator[Handed]:
        held, out = bytearray(), -1.0
        for at, data in ticks:
            if out < 0.0:
                out = at + random.uniform(0.0, timer_s)
            for number, byte in enumerate(data, 1):
                arrived = at + number * BYTE_S
                while out < arrived:
                    if held:
                        yield out, bytes(held)
                        held.clear()
                    out += timer_s * DRIFT
                held.append(byte)
                if len(held) == PACKET:
                    yield arrived, bytes(held)
                    held.clear()
                    out = arrived + timer_s

    return handed


ADAPTERS: Final[dict[str, Adapter]] = {
    "pieces of 1 to 16 bytes": pieces,
    "1 ms timer": packets(0.001),
    "16 ms timer": packets(0.016),
    "whole ticks": whole,
}
