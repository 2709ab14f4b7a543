# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A bad network: datagrams that are lost, come twice, or come late and overtake each other.

Knows datagrams, chances and board time; not what they mean.
"""

import heapq
from collections import Counter
from dataclasses import dataclass
from random import Random


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkFaults:
    """What happens to each datagram, either way.

    lose, duplicate: chances. delay_s: each copy is delayed by up to this time, evenly
    distributed, so that later ones may overtake it.
    """

    lose: float = 0.0
    duplicate: float = 0.0
    delay_s: float = 0.0


_GOOD = NetworkFaults()


class NetworkPath:
    """One way through a network. Equal datagrams, times and seeds meet the same fate.

    lost, duplicated: datagrams so far.
    """

    def __init__(self, faults: NetworkFaults, seed: str) -> None:
        self.lost = self.duplicated = 0
        self._faults = faults
        self._random = Random(seed)
        self._on_their_way: list[tuple[float, int, bytes]] = []
        self._sent = 0

    def send(self, datagram: bytes, at_s: float) -> None:
        """Give it to the network, at this board time."""
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

    def arrived(self, now_s: float) -> list[bytes]:
        """The datagrams that arrive up to this board time and have not been returned before."""
        out = []
        while self._on_their_way and self._on_their_way[0][0] <= now_s:
            out.append(heapq.heappop(self._on_their_way)[2])
        return out


class FaultyNetwork:
    """The two ways of one channel, each with chances of its own."""

    def __init__(self, faults: NetworkFaults = _GOOD, seed: int | str = 0) -> None:
        self.to_board = NetworkPath(faults, f"to board {seed}")
        self.from_board = NetworkPath(faults, f"from board {seed}")

    @property
    def counts(self) -> Counter[str]:
        """Datagrams that met a fault, by its name, both ways."""
        paths = (self.to_board, self.from_board)
        return Counter(
            lost=sum(path.lost for path in paths), duplicated=sum(path.duplicated for path in paths)
        )
