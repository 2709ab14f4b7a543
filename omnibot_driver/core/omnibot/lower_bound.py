# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A lower bound for the cost of interpreting the remaining bytes, found from headers alone.

Bytes without headers cost at least as much as the fewest damaged frames that can cover them.

Input: bytes. Output: for each position in the bytes, the least possible cost of all bytes after it.
This module does not know the search (``trellis``), which uses the bound.
"""

import re
from typing import Final

from omnibot_driver.core.omnibot.cost_model import BAD_BYTE, ONE_BYTE
from omnibot_driver.core.omnibot.frames import INCOMPLETE, NO_FRAME, measure

DAMAGE: Final = ONE_BYTE
REACH: Final = 15 + 2
"""Largest number of bytes that one damaged frame covers.

The longest frame has 15 bytes, and damage on the line can add 2.
"""

_BEGINNING: Final = re.compile(rb"\xff[\xfa-\xfc]|\xff\Z|P")
_RAMP: Final = [BAD_BYTE * left for left in range(int(DAMAGE / BAD_BYTE), 0, -1)]
"""Costs of the rest of a run of unexplained bytes (a bad run), if 15, 14, ... 1 bytes are left.

The cost of 15 bytes is a little below ``DAMAGE``, the cost of a damaged frame.
"""


def least_costs(data: bytes) -> list[float]:
    """Return, for each node of the graph in ``trellis``, the least cost to the end of ``data``.

    The bound is consistent: along an edge, it decreases by at most the edge's cost. An incomplete
    last frame costs 0.
    """
    size = len(data)
    ends = _undamaged(data)
    first = min((at for at, end in ends.items() if end == size), default=size)
    boundaries, runs = [0.0] * (size + 1), [0.0] * (size + 1)
    # At a place where no undamaged frame begins, a damaged frame or a bad run begins. A damaged
    # frame covers at most REACH bytes and costs at least DAMAGE. A bad run costs more per byte.
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
    """Return the end of each row of consecutive undamaged frames, by the start of the row.

    The starts are all positions where an undamaged frame may start, in descending order.
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
