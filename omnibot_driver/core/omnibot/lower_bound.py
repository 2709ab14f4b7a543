# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What the rest of a reading costs at the least, told by the headers alone.

From a header frames lead on without damage to a place where none begins. Each damage leads on by
no more than ``REACH`` bytes and costs no less than ``DAMAGE``; a bad run costs more by the byte. So
the least number of damages on the way to the end of a stretch is known before anything is weighed.
This module knows the shapes of frames and the cheapest prices; ``trellis`` knows what is searched.
"""

import re
from typing import Final

from omnibot_driver.core.omnibot.cost_model import BAD_BYTE, ONE_BYTE
from omnibot_driver.core.omnibot.frames import INCOMPLETE, NO_FRAME, measure

DAMAGE: Final = ONE_BYTE
REACH: Final = 15 + 2
"""The longest frame, with two bytes added."""

_BEGINNING: Final = re.compile(rb"\xff[\xfa-\xfc]|\xff\Z|P")
_RAMP: Final = [BAD_BYTE * left for left in range(int(DAMAGE / BAD_BYTE), 0, -1)]
"""A bad run that is about to end is cheaper than another damage."""


def least_costs(data: bytes) -> list[float]:
    """For each node of the trellis: the least cost from there to the end, while more may follow.

    Along an edge it grows by the edge's price at the most.
    """
    size = len(data)
    ends = _undamaged(data)
    first = min((at for at, end in ends.items() if end == size), default=size)
    boundaries, runs = [0.0] * (size + 1), [0.0] * (size + 1)
    filled, damages, reach = size, 0, size
    while reach > 0:
        damages += 1
        reach = max(0, first - REACH)
        if reach < filled:
            boundaries[reach:filled] = [damages * DAMAGE] * (filled - reach)
            filled = reach
        last, first = first, min((at for at, end in ends.items() if end >= reach), default=reach)
        first = min(first, reach)
        ramp = [(damages - 1) * DAMAGE + left for left in _RAMP]
        flat = [damages * DAMAGE] * (last - first - len(ramp))
        runs[first:last] = (flat + ramp)[len(flat) + len(ramp) - (last - first) :]
    for at, end in ends.items():
        boundaries[at] = boundaries[end]
    least = [0.0] * (2 * size + 3)
    least[0:-1:2] = runs
    least[1:-1:2] = boundaries
    return least


def _undamaged(data: bytes) -> dict[int, int]:
    """The ends of whole frames that begin here, one after the other; the last one first."""
    size = len(data)
    ends: dict[int, int] = {}
    for found in reversed([*_BEGINNING.finditer(data)]):
        at = found.start()
        length = measure(data, at)
        if length != NO_FRAME:
            end = size if length == INCOMPLETE else at + length
            ends[at] = ends.get(end, end)
    return ends
