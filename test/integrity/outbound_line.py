# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What happens to the driver's bytes on their way to the board.

Knows bytes only as bytes.
"""

import math
from collections.abc import Callable
from random import Random
from typing import Final, Protocol

ADDED: Final = -1
CHANGED: Final = -2

Arrival = tuple[int, float, int]
"""A byte; its place among those of its write, a fraction for one in between; and its origin: that
place, or ADDED or CHANGED."""
Change = Callable[[bytes, int, Random], list[Arrival]]


class Line(Protocol):
    """One line in one trial. `whole`: how many bytes arrive as they are before the next fault.

    A sender of a write that is no longer takes it off `whole`, and carries the others.
    """

    whole: int

    def carry(self, data: bytes) -> list[Arrival]:
        """The bytes that arrive of a write."""


Fault = Callable[[Random], Line]


class SingleFaults:
    """A line on which each byte is damaged with the same probability."""

    def __init__(self, rate: float, change: Change, random: Random) -> None:
        self.whole = _gap(rate, random)
        self._rate, self._change, self._random = rate, change, random

    def carry(self, data: bytes) -> list[Arrival]:
        """The bytes that arrive of a write."""
        arrivals: list[Arrival] = []
        at = 0
        while at < len(data):
            fault_at = min(len(data), at + self.whole)
            arrivals += [(data[n], n, n) for n in range(at, fault_at)]
            self.whole -= fault_at - at
            if fault_at < len(data):
                arrivals += self._change(data, fault_at, self._random)
                self.whole = _gap(self._rate, self._random)
            at = fault_at + 1
        return arrivals


class NoFaults:
    """A good line."""

    whole = 1 << 62

    def carry(self, data: bytes) -> list[Arrival]:
        """The line without faults: all bytes arrive."""
        return [(byte, at, at) for at, byte in enumerate(data)]


class Bursts:
    """Bytes in a row are lost, over any number of writes; `rate` of the bytes begin one."""

    def __init__(self, rate: float, longest: int, random: Random) -> None:
        self.whole, self._gone = _gap(rate, random), 0
        self._rate, self._longest, self._random = rate, longest, random

    def carry(self, data: bytes) -> list[Arrival]:
        """The bytes that arrive of a write."""
        arrivals: list[Arrival] = []
        for at, byte in enumerate(data):
            if self.whole:
                self.whole -= 1
                arrivals.append((byte, at, at))
                continue
            self._gone = (self._gone or self._random.randint(1, self._longest)) - 1
            if not self._gone:
                self.whole = _gap(self._rate, self._random)
        return arrivals


def _gap(rate: float, random: Random) -> int:
    """The number of bytes before the next fault."""
    return int(math.log(1.0 - random.random()) / math.log(1.0 - rate))


def _lost(_data: bytes, _at: int, _random: Random) -> list[Arrival]:
    return []


def _added(data: bytes, at: int, random: Random) -> list[Arrival]:
    """Add a byte, before this one or after it."""
    own, value = (data[at], at, at), random.randrange(256)
    if random.random() < 0.5:
        return [(value, at - 0.5, ADDED), own]
    return [own, (value, at + 0.5, ADDED)]


def _repeated(data: bytes, at: int, _random: Random) -> list[Arrival]:
    return [(data[at], at, at), (data[at], at + 0.5, ADDED)]


def _flipped(data: bytes, at: int, random: Random) -> list[Arrival]:
    return [(data[at] ^ 1 << random.randrange(8), at, CHANGED)]


def _single(rate: float, change: Change) -> Fault:
    return lambda random: SingleFaults(rate, change, random)


GOOD: Final = NoFaults()
LOSSES: Final[dict[str, Fault]] = {
    "1 byte in 1,000 lost": _single(1e-3, _lost),
    "1 byte in 100 lost": _single(1e-2, _lost),
    "1 byte in 20 lost": _single(5e-2, _lost),
}
OTHERS: Final[dict[str, Fault]] = {
    "1 byte in 1,000 added": _single(1e-3, _added),
    "1 byte in 1,000 repeated": _single(1e-3, _repeated),
    "1 bit flipped in 10,000 bytes": _single(1e-4, _flipped),
    "bursts of 1-200 bytes lost": lambda random: Bursts(5e-4, 200, random),
}
FAULTS: Final[dict[str, Fault]] = {**LOSSES, **OTHERS}
