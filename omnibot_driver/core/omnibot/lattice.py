# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""All readings of a stretch of bytes at once, the cheapest of them, and how far it is ahead.

Nodes are the places between bytes, each twice: as a boundary of frames, and within a bad run.
Edges are whole frames, damaged ones, bad bytes. A shortest path is the best reading; the shortest
path that reads the same byte in another way tells how sure a frame of it is. This module knows the
shapes that a line gives to frames; prices are in ``evidence``. Work and memory are proportional to
the stretch.

The context of a node (for the price of content) is that of the cheapest way to it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Final

from omnibot_driver.core.omnibot import evidence
from omnibot_driver.core.omnibot.evidence import Context, Expectation
from omnibot_driver.core.omnibot.frames import (
    ByteOrder,
    Frame,
    decode_measured,
    measure,
)

Gap = tuple[int, int, float]
"""Somewhere from the first place on, and before the second, the line was idle; and the price of a
frame around it."""

_LENGTHS: Final = {0xFA: 14, 0xFB: 9, 0xFC: 15}
_HEADERS: Final = tuple(bytes((0xFF, kind)) for kind in _LENGTHS)
_MISFITS: Final = (
    (-1, evidence.ONE_BYTE),
    (1, evidence.ONE_BYTE),
    (-2, evidence.TWO_BYTES),
    (2, evidence.TWO_BYTES),
)
_HEADER: Final = 0xFF
_TEXT: Final = 0x50


@dataclass(frozen=True, slots=True)
class Piece:
    """A whole frame of the best reading; ``margin``: what any other reading of it costs more."""

    start: int
    end: int
    frame: Frame
    before: Context
    after: Context
    margin: float


_Edge = tuple[int, int, float, Frame | None, Context]
"""From node, to node, price, the whole frame, context after it."""


def read(
    data: bytes,
    context: Context,
    expectation: Expectation,
    gaps: Sequence[Gap],
    pose_byte_order: ByteOrder,
    *,
    in_step: bool,
    closed: bool,
) -> list[Piece]:
    """The whole frames of the best reading of ``data``.

    ``in_step``: a frame ended right before; ``closed``: nothing follows, ever.
    """
    search = _Search(data, context, expectation, gaps, pose_byte_order)
    search.forward(in_step, closed)
    return search.pieces()


class _Search:
    def __init__(
        self,
        data: bytes,
        context: Context,
        expectation: Expectation,
        gaps: Sequence[Gap],
        pose_byte_order: ByteOrder,
    ) -> None:
        self._data = data
        self._expectation = expectation
        self._gaps = gaps
        self._pose_byte_order = pose_byte_order
        size = len(data)
        # Node 2 n: in a bad run before byte n; 2 n + 1: at a boundary there; the last: the end.
        self._end = 2 * size + 2
        self._cost = [inf] * (self._end + 1)
        self._by = [-1] * (self._end + 1)
        self._contexts = [context] * (self._end + 1)
        self._edges: list[_Edge] = []

    def forward(self, in_step: bool, closed: bool) -> None:
        data, cost, size = self._data, self._cost, len(self._data)
        cost[0], cost[1] = inf if in_step else evidence.UNKNOWN_START, 0.0
        for at in range(size):
            byte = data[at]
            bad, boundary = 2 * at, 2 * at + 1
            header = byte == _HEADER and at + 1 < size and data[at + 1] in _LENGTHS
            price = evidence.BAD_BYTE
            if byte == _TEXT and measure(data, at) > 0:
                price += evidence.BAD_TEXT
            if cost[bad] < inf:
                if byte in (_HEADER, _TEXT):
                    self._edge(bad, boundary, 0.0)
                self._edge(bad, bad + 2, price + evidence.BAD_HEADER if header else price)
            if cost[boundary] < inf:
                price += evidence.BAD_RUN if header else evidence.BAD_RUN + evidence.BAD_TAIL
                self._edge(boundary, bad + 2, price, None, self._contexts[boundary].damaged())
                self._frames_from(at, closed)
        unexplained = evidence.ENDS_IN_NOISE if closed else 0.0
        for node, price in ((2 * size, unexplained), (2 * size + 1, 0.0)):
            if cost[node] < inf:
                self._edge(node, self._end, price)

    def _frames_from(self, at: int, closed: bool) -> None:
        data, size = self._data, len(self._data)
        byte = data[at]
        node = 2 * at + 1
        if byte == _TEXT:
            length = measure(data, at)
            if length > 0:
                self._whole(at, length)
            elif length == 0:
                self._open(at, evidence.CUT_SHORT if closed else 0.0)
        elif byte == _HEADER:
            if at + 1 == size:
                self._open(at, evidence.CUT_SHORT if closed else 0.0)
                return
            length = _LENGTHS.get(data[at + 1], 0)
            if length:
                if at + length <= size:
                    self._whole(at, length)
                else:
                    self._open(at, evidence.CUT_SHORT if closed else 0.0)
                followed = data[at + length : at + length + 2] in _HEADERS
                for end in range(at + 2, min(at + length - 2, size - 1)):
                    if data[end] == _HEADER and data[end + 1] in _LENGTHS:
                        self._damaged(node, at, end, evidence.BROKEN_OFF)
                for more, price in _MISFITS:
                    if followed and more > 0:
                        price += evidence.HEADER_IN_PLACE
                    if at + length + more <= size:
                        self._damaged(node, at, at + length + more, price)
                    elif not closed:
                        self._open(at, price)
            else:
                for length in (13, 8, 14):
                    self._headless(node, at, length, closed)
        elif byte in _LENGTHS:
            self._headless(node, at, _LENGTHS[byte] - 1, closed)

    def _headless(self, node: int, at: int, length: int, closed: bool) -> None:
        if at + length <= len(self._data):
            self._damaged(node, at, at + length, evidence.HEADER_BYTE)
        elif not closed:
            self._open(at, evidence.HEADER_BYTE)

    def _whole(self, at: int, length: int) -> None:
        frame = decode_measured(self._data[at : at + length], self._pose_byte_order)
        price, after = self._expectation.weigh(frame, self._contexts[2 * at + 1])
        price += self._idle_within(at, at + length)
        self._edge(2 * at + 1, 2 * (at + length) + 1, price, frame, after)

    def _damaged(self, node: int, at: int, end: int, price: float) -> None:
        price += self._idle_within(at, end)
        self._edge(node, 2 * end + 1, price, None, self._contexts[node].damaged())

    def _open(self, at: int, price: float) -> None:
        """A frame, whole or damaged, whose end has not come yet."""
        self._edge(2 * at + 1, self._end, price + self._idle_within(at, len(self._data)))

    def _idle_within(self, start: int, end: int) -> float:
        return sum(
            price for first, before, price in self._gaps if start < first < end and before <= end
        )

    def _edge(
        self,
        start: int,
        end: int,
        price: float,
        frame: Frame | None = None,
        after: Context | None = None,
    ) -> None:
        context = self._contexts[start] if after is None else after
        total = self._cost[start] + price
        if total < self._cost[end]:
            self._cost[end] = total
            self._by[end] = len(self._edges)
            self._contexts[end] = context
        self._edges.append((start, end, price, frame, context))

    def pieces(self) -> list[Piece]:
        """Walk the best path back, then ask every edge what the best path through it costs."""
        edges, cost = self._edges, self._cost
        path: list[int] = []
        node = self._end
        while self._by[node] >= 0:
            path.append(self._by[node])
            node = edges[path[-1]][0]
        path = [index for index in reversed(path) if edges[index][3] is not None]
        if not path:
            return []
        starts = [edges[index][0] >> 1 for index in path]
        next_piece = [0] * (len(self._data) + 2)
        number = 0
        for at in range(len(next_piece)):
            while number < len(starts) and starts[number] < at:
                number += 1
            next_piece[at] = number
        rest = [inf] * (self._end + 1)
        rest[self._end] = 0.0
        others = [inf] * len(path)
        for index in range(len(edges) - 1, -1, -1):
            start, end, price, _, _ = edges[index]
            onward = price + rest[end]
            if onward < rest[start]:
                rest[start] = onward
            covers_to = end >> 1
            number = next_piece[start >> 1]
            while number < len(starts) and starts[number] < covers_to:
                if path[number] != index and cost[start] + onward < others[number]:
                    others[number] = cost[start] + onward
                number += 1
        best = cost[self._end]
        found = []
        for number, index in enumerate(path):
            start, end, _, frame, after = edges[index]
            assert frame is not None
            before = self._contexts[start]
            margin = others[number] - best
            found.append(Piece(start >> 1, end >> 1, frame, before, after, margin))
        return found
