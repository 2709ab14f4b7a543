# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A simulated board on a line that can be broken, and a record of what the board sent.

This module does not depend on the format of the frames.
"""

from collections.abc import Callable
from random import Random
from typing import Any, Final

from rig_board import RigBoard

from omnibot_driver.simulator.common.board import Packet
from omnibot_driver.simulator.common.faults import FaultyLine, LineFaults

TICK_S: Final = 0.01
BYTES_PER_TICK: Final = 115
"""Number of bytes that the line carries in one tick, at 115200 baud."""

Damage = Callable[[bytes], bytes]


def whole(data: bytes) -> bytes:
    return data


def cut(_data: bytes) -> bytes:
    return b""


def losing(rate: float, random: Random) -> Damage:
    """Return a function that loses single bytes of the line, each with the probability ``rate``."""
    return FaultyLine(LineFaults(lose=rate), random.getrandbits(32)).carry


def losing_bursts(rate: float, random: Random) -> Damage:
    """Return a function that loses 1 to 200 bytes of the line in a row.

    ``rate``: the probability that a loss begins at a byte.
    """
    return FaultyLine(LineFaults(burst=rate), random.getrandbits(32)).carry


def gaining(rate: float, random: Random) -> Damage:
    """Return a function that inserts bytes of any value into the line.

    ``rate``: the probability that a byte is inserted before a byte of the line.
    """

    def damage(data: bytes) -> bytes:
        out = bytearray()
        for byte in data:
            if random.random() < rate:
                out.append(random.randrange(256))
            out.append(byte)
        return bytes(out)

    return damage


def noise(random: Random) -> Damage:
    """Return a function that replaces all bytes by random ones, as a wrong baud rate does.

    The function ignores its argument, and returns as many bytes as fit into a tick.
    """
    return lambda _data: random.randbytes(BYTES_PER_TICK)


def late(ticks: int) -> Damage:
    """Return a function that collects the bytes of ``ticks`` ticks, as some adapters do.

    It then delivers all collected bytes together, and begins to collect again.
    """
    held: list[bytes] = []

    def damage(data: bytes) -> bytes:
        held.append(data)
        if len(held) < ticks:
            return b""
        out = b"".join(held)
        held.clear()
        return out

    return damage


class BreakableLine:
    """A simulated board behind a line that can be damaged.

    ``sent``: the frames that the board sent, without the damage.

    ``driven_at``: the last tick in which the motors had a command to turn.
    """

    tick_s = TICK_S

    def __init__(self, kind: RigBoard, settings: Any = None) -> None:
        self.board = kind.make(settings)
        self.channels = self.board.channels
        self._kind = kind
        self.to_board = self.from_board = whole
        self.sent: list[bytes] = []
        self.driven_at = -1

    @property
    def tick(self) -> int:
        return int(self.board.tick)

    def heal(self) -> None:
        self.to_board = self.from_board = whole

    def receive(self, data: bytes, at_s: float | None = None, channel: int = 0) -> None:
        self.board.receive(self.to_board(data), at_s, channel)

    def advance(self) -> list[Packet]:
        packets = self.board.advance()
        self.sent += self._kind.sent(self.board)
        if self.board.driven:
            self.driven_at = self.board.tick
        if len(self.channels) == 1:  # damage may add bytes where the board sends none
            packets = [(0, b"".join(data for _, data in packets))]
        arrived = [(channel, self.from_board(data)) for channel, data in packets]
        return [(channel, data) for channel, data in arrived if data]
