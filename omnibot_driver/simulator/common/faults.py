# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A faulty serial line: it loses bytes, one by one or in bursts, and flips bits.

This module must not know what the bytes mean.
"""

from collections import Counter
from dataclasses import dataclass
from random import Random

LONGEST_BURST = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class LineFaults:
    """Probability of each fault, per byte.

    * ``lose``: the byte is lost.
    * ``burst``: the byte and up to 199 bytes after it are lost.
    * ``flip``: one bit of the byte changes.
    """

    lose: float = 0.0
    burst: float = 0.0
    flip: float = 0.0


_GOOD = LineFaults()


class FaultyLine:
    """A serial line with random faults, which depend only on the bytes and the seed.

    lost, flipped: numbers of bytes lost and changed so far.
    """

    def __init__(self, faults: LineFaults = _GOOD, seed: int | str = 0) -> None:
        self.lost = self.flipped = 0
        self._faults = faults
        self._random = Random(f"line {seed}")
        self._burst_left = 0

    @property
    def counts(self) -> Counter[str]:
        """Numbers of ``lost`` and ``flipped`` bytes so far, by these names."""
        return Counter(lost=self.lost, flipped=self.flipped)

    def carry(self, data: bytes) -> bytes:
        """Return the bytes that arrive when ``data`` is sent."""
        if self._faults == _GOOD:
            return data
        arrived = bytearray()
        for byte in data:
            if self._random.random() < self._faults.burst:
                self._burst_left = self._random.randint(1, LONGEST_BURST)
            if self._burst_left:
                self._burst_left -= 1
                self.lost += 1
            elif self._random.random() < self._faults.lose:
                self.lost += 1
            elif self._random.random() < self._faults.flip:
                self.flipped += 1
                arrived.append(byte ^ 1 << self._random.randrange(8))
            else:
                arrived.append(byte)
        return bytes(arrived)
