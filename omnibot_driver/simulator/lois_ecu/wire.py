# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The protocol as the board encodes and decodes it, from the manual and the public firmware.

A line: ``:``, command (2 hexadecimal digits), payload (8), checksum (2: XOR of all characters
before it), line feed. This module shares no code with the driver, and does not know what a command
means.
"""

import re
import struct
from collections.abc import Iterator
from string import hexdigits

LINE_CHARACTERS = 14
LEADING_HEX = re.compile(r"[ \t\n\v\f\r]*([-+]?)(?:0[xX](?=[0-9a-fA-F]))?([0-9a-fA-F]+)")
CHECKED_CHARACTERS = 11


def _sum_of(characters: str) -> int:
    total = 0
    for character in characters:
        total ^= ord(character)
    return total


def line(command: int, payload: int) -> bytes:
    """Encode one line."""
    body = f":{command & 0xFF:02x}{payload & 0xFFFFFFFF:08x}"
    return f"{body}{_sum_of(body):02x}\n".encode("ascii")


def words(command: int, high: int, low: int) -> bytes:
    """Encode one line whose payload is two 16-bit words."""
    return line(command, (high & 0xFFFF) * 0x10000 + (low & 0xFFFF))


def bits_of(number: float) -> int:
    """Return the bits of ``number`` as a float32. A number that is too large becomes infinity."""
    try:
        return int.from_bytes(struct.pack(">f", number), "big")
    except OverflowError:
        return 0x7F800000 if number > 0 else 0xFF800000


def number_of(bits: int) -> float:
    """Return the number that ``bits`` encode as a float32."""
    (number,) = struct.unpack(">f", bits.to_bytes(4, "big"))
    return float(number)


def sequence(command: int, payloads: list[int]) -> bytes:
    """Encode a marker line (payload 0xFFFFFFFF), and then one line for each of ``payloads``.

    All lines have the same ``command``.
    """
    return b"".join(line(command, payload) for payload in (0xFFFFFFFF, *payloads))


class LineReader:
    """Decoder of the lines that the board receives, character by character.

    * ``checks``: whether lines have a checksum.
    * ``lenient``: whether fields are read as by C's strtol, which accepts blanks, a sign and 0x
      before the digits, and any text after them.
    """

    def __init__(self, *, lenient: bool) -> None:
        self.checks = True
        self._lenient = lenient
        self._buffer: list[str] = []

    def take(self, character: int) -> tuple[int, int] | None:
        """Process a character. If it completes a valid line, return command and payload."""
        letter = chr(character)
        length = LINE_CHARACTERS if self.checks else LINE_CHARACTERS - 2
        if letter == ":" or len(self._buffer) >= length:
            self._buffer.clear()
        self._buffer.append(letter)
        if letter != "\n" or len(self._buffer) != length:
            return None
        text = "".join(self._buffer)
        fields = text[1:3], text[3:7], text[7:11], text[11:-1]
        if not self._lenient and not all(set(field) <= set(hexdigits) for field in fields):
            return None
        command, high, low, sent = map(_leading_hex, fields)
        high, low = high & 0xFFFF, low & 0xFFFF
        if self.checks and sent != _sum_of(text[:CHECKED_CHARACTERS]):
            return None
        return command, high * 0x10000 + low

    def take_all(self, data: bytes) -> Iterator[tuple[int, int]]:
        """Process many characters. Yield command and payload of each valid line."""
        for character in data:
            found = self.take(character)
            if found is not None:
                yield found


def _leading_hex(field: str) -> int:
    found = LEADING_HEX.match(field)
    return int(found[1] + found[2], 16) if found else 0
