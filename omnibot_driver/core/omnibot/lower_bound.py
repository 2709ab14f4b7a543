# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A lower bound for the cost of the remaining bytes, by their headers alone.

From a header, frames without damage lead to a place where none begins. Each damage leads on by at
most ``REACH`` bytes and costs at least ``DAMAGE``; a bad run costs more per byte. So the least
number of damages up to the end of a stretch is known before any content is weighed. This module
knows the shapes of frames and the lowest prices; ``trellis`` knows what is searched.
"""

import re
from typing import Final

from omnibot_driver.core.omnibot.cost_model import BAD_BYTE, ONE_BYTE
from omnibot_driver.core.omnibot.frames import INCOMPLETE, NO_FRAME, measure

DAMAGE: Final = ONE_BYTE
REACH: Final = 15 + 2
"""Length in bytes of the longest frame with two bytes added."""

_BEGINNING: Final = re.compile(rb"\xff[\xfa-\xfc]|\xff\Z|P")
_RAMP: Final = [BAD_BYTE * left for left in range(int(DAMAGE / BAD_BYTE), 0, -1)]
"""Costs of the last bytes of a bad run, where they are less than another damage."""


def least_costs(data: bytes) -> list[float]:
    """Return, for each node of the trellis, the least cost from there to the end of ``data``.

    It holds while more bytes may follow. Along an edge it falls by at most the edge's price.
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
    """Return the end of the chain of complete frames that begins at each place.

    Keys are places of first bytes, the last one first.
    """
    size = len(data)
    ends: dict[int, int] = {}
    for found in reversed([*_BEGINNING.finditer(data)]):
        at = found.start()
        length = measure(data, at)
        if length != NO_FRAME:
            end = size if length == INCOMPLETE else at + length
            ends[at] = ends.get(end, end)
    return ends
