# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A bad line: bytes that are lost, alone or in bursts, and bits that change on the way.

Knows bytes and chances; not what they mean.
"""

from collections import Counter
from dataclasses import dataclass
from random import Random

LONGEST_BURST = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class LineFaults:
    """Chances for each byte: `lose` it; `burst`: lose it and up to 199 bytes after it; `flip` one
    of its bits.
    """

    lose: float = 0.0
    burst: float = 0.0
    flip: float = 0.0


_GOOD = LineFaults()


class FaultyLine:
    """The same bytes and seed meet the same fate, however they are cut.

    lost, flipped: bytes so far.
    """

    def __init__(self, faults: LineFaults = _GOOD, seed: int | str = 0) -> None:
        self.lost = self.flipped = 0
        self._faults = faults
        self._random = Random(f"line {seed}")
        self._burst_left = 0

    @property
    def counts(self) -> Counter[str]:
        """The number of bytes of each fault, by its name."""
        return Counter(lost=self.lost, flipped=self.flipped)

    def carry(self, data: bytes) -> bytes:
        """The bytes that arrive of these."""
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
