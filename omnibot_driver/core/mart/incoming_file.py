# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A file that arrives in datagrams: pieces of 512 bytes without numbers, and a shorter last piece.

This module knows pieces; it does not know which file was requested, or when a piece comes.
"""

import math
from dataclasses import dataclass, field
from typing import Final

PIECE: Final = 512


@dataclass(slots=True)
class IncomingFile:
    """The pieces of a file that have arrived. ``name``, ``size``: as the server announced them."""

    name: str
    size: int
    pieces: list[bytes] = field(default_factory=list)

    def add(self, data: bytes) -> bool:
        """Keep a datagram as a piece of the file, and return whether it may be one.

        The datagram must be as long as a full piece, or as the last piece.
        """
        fits = bool(data) and len(data) in (PIECE, self.size % PIECE)
        if fits:
            self.pieces.append(data)
        return fits

    @property
    def came(self) -> int:
        """The number of bytes that have arrived."""
        return sum(map(len, self.pieces))

    @property
    def complete(self) -> bool:
        """Whether as many pieces have arrived as the file has."""
        return len(self.pieces) * PIECE >= self.size

    @property
    def content(self) -> bytes:
        """The pieces, joined in the order of their arrival."""
        return b"".join(self.pieces)

    @property
    def order_is_sure(self) -> bool:
        """Whether the lengths of the pieces show their order: at most one piece is full.

        A full piece and the shorter last piece differ in length, but two full pieces do not.
        """
        return len(self._full) <= 1

    @property
    def has_equal_pieces(self) -> bool:
        """Whether two full pieces are equal. Perhaps one came twice, and another one is lost."""
        return len(set(self._full)) < len(self._full)

    @property
    def fault(self) -> str:
        """Message that pieces are lost, doubled or in the wrong order, judged by their lengths.

        It is empty if the lengths show no fault.
        """
        if self.came < self.size:
            lost = math.ceil((self.size - self.came) / PIECE)
            return f"{lost} pieces of {self.name} were lost"
        if self.came > self.size:
            return f"pieces of {self.name} came twice"
        if any(len(piece) < PIECE for piece in self.pieces[:-1]):
            return f"pieces of {self.name} arrived in the wrong order"
        return ""

    @property
    def _full(self) -> list[bytes]:
        return [piece for piece in self.pieces if len(piece) == PIECE]
