# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A faulty network: it loses, duplicates, delays and reorders datagrams.

This module must not know what the datagrams mean.
"""

import heapq
import math
from collections import Counter
from dataclasses import dataclass
from random import Random


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkFaults:
    """Faults of a network, which apply to each datagram, in both directions.

    * ``lose``, ``duplicate``: probabilities that a datagram is lost or duplicated.
    * ``delay_s``: longest random delay of a datagram or duplicate, in s. Delays may change the
      order of the datagrams.
    """

    lose: float = 0.0
    duplicate: float = 0.0
    delay_s: float = 0.0


_GOOD = NetworkFaults()


class NetworkPath:
    """One direction of a network.

    The faults depend only on the datagrams, their times and the seed.

    lost, duplicated: numbers of datagrams lost and duplicated so far.
    """

    def __init__(self, faults: NetworkFaults, seed: str) -> None:
        self.lost = self.duplicated = 0
        self._faults = faults
        self._random = Random(seed)
        self._on_their_way: list[tuple[float, int, bytes]] = []
        self._sent = 0

    def send(self, datagram: bytes, at_s: float) -> None:
        """Send a datagram into the network at the board time ``at_s``, in s."""
        if self._random.random() < self._faults.lose:
            self.lost += 1
            return
        copies = 1
        if self._random.random() < self._faults.duplicate:
            self.duplicated += 1
            copies = 2
        for _ in range(copies):
            due_s = at_s + self._faults.delay_s * self._random.random()
            heapq.heappush(self._on_their_way, (due_s, self._sent, datagram))
            self._sent += 1

    @property
    def next_s(self) -> float:
        """Board time, in s, at which the next datagram arrives; infinite if none is on its way."""
        return self._on_their_way[0][0] if self._on_their_way else math.inf

    def arrived(self, now_s: float) -> list[bytes]:
        """Remove and return the datagrams that have arrived by the board time ``now_s``, in s."""
        out = []
        while self._on_their_way and self._on_their_way[0][0] <= now_s:
            out.append(heapq.heappop(self._on_their_way)[2])
        return out


class FaultyNetwork:
    """Both directions of one channel, with equal ``NetworkFaults`` and separate random numbers."""

    def __init__(self, faults: NetworkFaults = _GOOD, seed: int | str = 0) -> None:
        self.to_board = NetworkPath(faults, f"to board {seed}")
        self.from_board = NetworkPath(faults, f"from board {seed}")

    @property
    def counts(self) -> Counter[str]:
        """Numbers of datagrams, in both directions, with the keys ``lost`` and ``duplicated``."""
        paths = (self.to_board, self.from_board)
        return Counter(
            lost=sum(path.lost for path in paths), duplicated=sum(path.duplicated for path in paths)
        )
