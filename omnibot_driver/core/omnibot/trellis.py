# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The search for the cheapest interpretation of a stretch of bytes, and for its sure frames.

An interpretation is a path in a graph. The edges of the graph are frames, damaged frames and
unexplained bytes, each with a cost. A frame on the cheapest path is sure if every path without this
frame costs clearly more.

This module knows which lengths a damaged frame can have; it does not know which frames are
accepted.
"""

from bisect import bisect_left
from math import inf
from typing import Final

from omnibot_driver.core.omnibot import cost_model
from omnibot_driver.core.omnibot.cost_model import Context, Expectation
from omnibot_driver.core.omnibot.frames import (
    INCOMPLETE,
    ByteOrder,
    Frame,
    decode_measured,
    measure,
)
from omnibot_driver.core.omnibot.gaps import InterFrameGaps
from omnibot_driver.core.omnibot.lower_bound import DAMAGE, least_costs
from omnibot_driver.core.values import value

SURE: Final = 3.5
"""Cost difference that makes a frame sure. Every other interpretation of the frame's first byte
costs at least this much more, and is at least 30 times less likely."""
STEP: Final = 5.5
"""First cost limit of the search, as a distance above the lower bound of the cost.

Interpretations that cost more than the limit are not searched. The limit rises until the search
finds an interpretation.
"""
BEYOND: Final = 0.025
"""Small addition to the cost limit, so that rounding errors have no effect.

All costs are multiples of 0.05; this addition is half of 0.05.
"""

_LENGTHS: Final = {0xFA: 14, 0xFB: 9, 0xFC: 15}
_HEADERS: Final = tuple(bytes((0xFF, kind)) for kind in _LENGTHS)
_Shapes = tuple[tuple[int, float], ...]
"""Possible lengths of a damaged frame in bytes, each with its cost."""


def _misfits(length: int, gained: float) -> _Shapes:
    one, two = cost_model.ONE_BYTE, cost_model.TWO_BYTES
    return (
        (length - 1, one),
        (length + 1, one + gained),
        (length - 2, two),
        (length + 2, two + gained),
    )


_MISFITS: Final = {length: _misfits(length, 0.0) for length in _LENGTHS.values()}
_MISFITS_FOLLOWED: Final = {
    length: _misfits(length, cost_model.HEADER_IN_PLACE) for length in _LENGTHS.values()
}
_HEADLESS: Final = {
    0xFF: ((13, cost_model.HEADER_BYTE), (8, cost_model.HEADER_BYTE), (14, cost_model.HEADER_BYTE)),
    **{kind: ((length - 1, cost_model.HEADER_BYTE),) for kind, length in _LENGTHS.items()},
}
"""Possible lengths and costs of a frame that has lost one of its two header bytes. The key is the
header byte that is left."""
_HEADER: Final = 0xFF
_TEXT: Final = 0x50
_BEGINNINGS: Final = (_HEADER, _TEXT)


@value(frozen=True, slots=True)
class Segment:
    """A complete frame of the best interpretation.

    * ``start``, ``end``: its position among the bytes.
    * ``sure``: whether every other interpretation of its first byte costs clearly more.
    """

    start: int
    end: int
    frame: Frame
    before: Context
    after: Context
    sure: bool


_Edge = tuple[int, int, float, Frame | None, Context | None]
"""An edge of the graph: start node, end node, cost, frame, and context after the frame. Frame and
context are None if the edge is not a complete frame."""


def read(
    data: bytes,
    context: Context,
    expectation: Expectation,
    pauses: InterFrameGaps,
    pose_byte_order: ByteOrder,
    *,
    in_step: bool,
    closed: bool,
) -> list[Segment]:
    """Return the complete frames of the best interpretation of ``data``.

    ``in_step``: whether an accepted frame ended right before ``data``. ``closed``: whether no more
    bytes follow, because the line was closed or fell silent.
    """
    search = _Search(data, context, expectation, pauses, pose_byte_order)
    search.run(in_step, closed)
    return search.pieces()


class _Search:
    def __init__(
        self,
        data: bytes,
        context: Context,
        expectation: Expectation,
        pauses: InterFrameGaps,
        pose_byte_order: ByteOrder,
    ) -> None:
        self._data = data
        self._expectation = expectation
        self._pauses = pauses
        self._pose_byte_order = pose_byte_order
        # Before byte n: node 2n in a bad run, node 2n + 1 at a frame boundary. Last node: the end.
        self._end = 2 * len(data) + 2
        self._start_context = context
        self._least: list[float]
        self._limit: float
        self._cost: list[float]
        self._by: list[_Edge | None]
        self._edges: list[_Edge]
        self._contexts: dict[int, Context]

    def run(self, in_step: bool, closed: bool) -> None:
        """Find the best interpretation, and all others that cost at most ``SURE`` more.

        ``in_step``: whether an accepted frame ended right before the bytes. ``closed``: whether no
        more bytes follow.
        """
        self._least = [0.0] * (self._end + 1) if closed else least_costs(self._data)
        step = STEP
        limit = self._least[1] + step + BEYOND
        while True:
            # Edges above the limit are omitted. The limit rises until no omitted edge can matter.
            self._forward(in_step, closed, limit)
            best = self._cost[self._end]
            if best + SURE <= limit:
                return
            if best < inf:
                limit = best + SURE + BEYOND
            else:
                limit, step = limit + step, 2 * step

    def _forward(self, in_step: bool, closed: bool, limit: float) -> None:
        data, size, least = self._data, len(self._data), self._least
        self._limit = limit
        self._cost = cost = [inf] * (self._end + 1)
        by: list[_Edge | None] = [None] * (self._end + 1)
        edges: list[_Edge] = []
        self._by, self._edges = by, edges
        self._contexts = {0: self._start_context, 1: self._start_context}
        cost[0], cost[1] = inf if in_step else cost_model.UNKNOWN_START, 0.0
        for at, byte in enumerate(data):
            bad = 2 * at
            run = cost[bad]
            if run == inf and cost[bad + 1] == inf:
                continue
            begins = byte in _BEGINNINGS
            price = onward = cost_model.BAD_BYTE
            begin_run = cost_model.BAD_RUN + cost_model.BAD_TAIL
            if begins:
                if byte == _TEXT and measure(data, at) > 0:
                    price = onward = price + cost_model.BAD_TEXT
                if byte == _HEADER and at + 1 < size and data[at + 1] in _LENGTHS:
                    onward, begin_run = price + cost_model.BAD_HEADER, cost_model.BAD_RUN
                if run < inf:
                    self._edge(bad, bad + 1, 0.0)
            if run + onward + least[bad + 2] <= limit:
                cost[bad + 2] = run + onward
                edges.append((bad, bad + 2, onward, None, None))
                by[bad + 2] = edges[-1]
            here = cost[bad + 1]
            if here < inf:
                price += begin_run
                if here + price + least[bad + 2] <= limit:
                    self._edge(bad + 1, bad + 2, price)
                if begins:
                    self._undamaged(at, closed)
                if here + DAMAGE <= limit and (byte == _HEADER or byte in _LENGTHS):
                    self._damaged(at, closed)
        unexplained = cost_model.ENDS_IN_NOISE if closed else 0.0
        for node, price in ((2 * size, unexplained), (2 * size + 1, 0.0)):
            if cost[node] < inf:
                self._edge(node, self._end, price)

    def _undamaged(self, at: int, closed: bool) -> None:
        """Add an edge for the undamaged frame or text that begins with the byte at ``at``."""
        data, node = self._data, 2 * at + 1
        length = measure(data, at)
        if length == INCOMPLETE:
            self._open(at, cost_model.CUT_SHORT if closed else 0.0)
        end = at + length
        if length <= 0 or self._cost[node] + self._least[2 * end + 1] > self._limit:
            return
        frame = decode_measured(data[at:end], self._pose_byte_order)
        price, after = self._expectation.weigh(frame, self._context(node))
        self._edge(node, 2 * end + 1, price + self._idle_within(at, end), frame, after)

    def _damaged(self, at: int, closed: bool) -> None:
        """Add edges for all damaged frames that could begin with the byte at ``at``."""
        data, size, node = self._data, len(self._data), 2 * at + 1
        spare = self._limit - self._cost[node]
        first = data[at]
        length = _LENGTHS.get(data[at + 1], 0) if first == _HEADER and at + 1 < size else 0
        if length:
            if spare >= cost_model.BROKEN_OFF:
                for end in range(at + 2, min(at + length - 2, size - 1)):
                    if data[end] == _HEADER and data[end + 1] in _LENGTHS:
                        price = cost_model.BROKEN_OFF + self._idle_within(at, end)
                        self._edge(node, 2 * end + 1, price)
            followed = data[at + length : at + length + 2] in _HEADERS
            shapes = (_MISFITS_FOLLOWED if followed else _MISFITS)[length]
        elif first == _HEADER and at + 1 == size:
            return
        else:
            shapes = _HEADLESS[first]
        for length, price in shapes:
            end = at + length
            if end > size:
                if not closed:
                    self._open(at, price)
            elif price + self._least[2 * end + 1] <= spare:
                self._edge(node, 2 * end + 1, price + self._idle_within(at, end))

    def _open(self, at: int, price: float) -> None:
        """Add an edge for a frame, damaged or not, that begins at ``at`` and has not ended yet."""
        self._edge(2 * at + 1, self._end, price + self._idle_within(at, len(self._data)))

    def _idle_within(self, start: int, end: int) -> float:
        return self._pauses.against(self._data, start, end) if self._pauses.gaps else 0.0

    def _edge(
        self,
        start: int,
        end: int,
        price: float,
        frame: Frame | None = None,
        after: Context | None = None,
    ) -> None:
        total = self._cost[start] + price
        if total + self._least[end] > self._limit:
            return
        edge = (start, end, price, frame, after)
        if total < self._cost[end]:
            self._cost[end] = total
            self._by[end] = edge
        self._edges.append(edge)

    def _context(self, node: int) -> Context:
        """Return the context at ``node``: what is known from the frames on the cheapest path to it.

        After a damaged frame or unexplained bytes, little is known.
        """
        found, damaged, at = self._contexts.get(node), False, node
        while found is None:
            edge = self._by[at]
            assert edge is not None
            at, _, _, _, found = edge
            if found is None:
                damaged = damaged or at % 2 == 1
                found = self._contexts.get(at)
        self._contexts[node] = found = found.damaged() if damaged else found
        return found

    def pieces(self) -> list[Segment]:
        """Return the complete frames on the cheapest path, and mark those that are sure."""
        cost = self._cost
        path: list[_Edge] = []
        edge = self._by[self._end]
        while edge is not None:
            if edge[3] is not None:
                path.append(edge)
            edge = self._by[edge[0]]
        path.reverse()
        starts = [edge[0] >> 1 for edge in path]
        rest = [inf] * (self._end + 1)
        rest[self._end] = 0.0
        sure = [True] * len(path)
        best = cost[self._end]
        for edge in reversed(self._edges):
            start, end, price, frame, _ = edge
            onward = price + rest[end]
            if onward == inf:
                continue
            if onward < rest[start]:
                rest[start] = onward
            if cost[start] + onward - best < SURE:
                for number in range(bisect_left(starts, start >> 1), bisect_left(starts, end >> 1)):
                    sure[number] = sure[number] and path[number][3] is frame
        return [
            Segment(start >> 1, end >> 1, frame, self._context(start), after, is_sure)
            for (start, end, _, frame, after), is_sure in zip(path, sure, strict=True)
            if frame is not None and after is not None
        ]
