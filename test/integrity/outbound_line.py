# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The line from the driver to the board, with its faults.

This module works on single bytes. It does not know frames.
"""

import math
from collections.abc import Callable
from random import Random
from typing import Final, Protocol

ADDED: Final = -1
CHANGED: Final = -2

Arrival = tuple[int, float, int]
"""A byte that arrives: its value, its place, and its origin.

* Place: the position in the driver's write; for an added byte, a number such as 3.5.
* Origin: equal to the place; for an added or changed byte, ``ADDED`` or ``CHANGED``.
"""
Change = Callable[[bytes, int, Random], list[Arrival]]


class Line(Protocol):
    """The damaged line of one trial.

    ``whole``: number of bytes before the next fault. A write of at most ``whole`` bytes arrives
    undamaged. The caller may subtract the write's length from ``whole`` instead of calling
    ``carry``.
    """

    whole: int

    def carry(self, data: bytes) -> list[Arrival]:
        """Return the bytes that arrive when ``data`` is written."""


Fault = Callable[[Random], Line]


class SingleFaults:
    """A line on which each byte is damaged with the same probability."""

    def __init__(self, rate: float, change: Change, random: Random) -> None:
        self.whole = _gap(rate, random)
        self._rate, self._change, self._random = rate, change, random

    def carry(self, data: bytes) -> list[Arrival]:
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
    """A line without faults."""

    whole = 1 << 62

    def carry(self, data: bytes) -> list[Arrival]:
        return [(byte, at, at) for at, byte in enumerate(data)]


class Bursts:
    """A line that loses several bytes in a row, even across writes.

    ``rate``: the probability that such a loss begins at a byte.
    """

    def __init__(self, rate: float, longest: int, random: Random) -> None:
        self.whole, self._gone = _gap(rate, random), 0
        self._rate, self._longest, self._random = rate, longest, random

    def carry(self, data: bytes) -> list[Arrival]:
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
    """Return a random number of bytes before the next fault."""
    return int(math.log(1.0 - random.random()) / math.log(1.0 - rate))


def _lost(_data: bytes, _at: int, _random: Random) -> list[Arrival]:
    return []


def _added(data: bytes, at: int, random: Random) -> list[Arrival]:
    """Return the byte at ``at`` and an additional byte of any value, before it or after it."""
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
