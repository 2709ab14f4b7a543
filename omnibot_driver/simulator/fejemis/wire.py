# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Reads and writes lines of text as a Teensy does, according to the manual and public programs.

The checksum ``;NN`` stands at the beginning of a line. Numbers are parsed as by C's ``strtof``.
This module must not know commands.
"""

import re
from enum import Enum

BUFFER = 200
"""Size of the line buffer, in characters. When the buffer is full, the next character clears it."""

_CONTROL_CHARACTERS = bytes(range(0x20))
_NUMBER = re.compile(r"[ \t]*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)")
_PREFIX = re.compile(r";(\d\d)")


class Check(Enum):
    """Result of the check of a line's checksum."""

    GOOD = "good"
    WRONG = "wrong"
    ABSENT = "absent"


def sum_of(text: str) -> int:
    """Return the checksum of a text, from 1 to 99."""
    return sum(text.encode("latin-1").translate(None, _CONTROL_CHARACTERS)) % 99 + 1


def line(text: str, *, sums: bool, carriage_return: bool) -> bytes:
    """Return the bytes of one line with its line end.

    ``sums``, ``carriage_return``: whether to add a checksum and a carriage return.
    """
    prefix = f";{sum_of(text):02d}" if sums else ""
    end = "\r\n" if carriage_return else "\n"
    return f"{prefix}{text}{end}".encode("latin-1")


def checked(text: str) -> tuple[Check, str, int]:
    """Check the checksum ``;NN`` at the beginning of a line.

    Return three values: the result of the check, the rest of the line, and the correct checksum (0
    if the line has no ``;NN``).
    """
    found = _PREFIX.match(text)
    if found is None:
        return Check.ABSENT, text, 0
    body = text[found.end() :]
    should = sum_of(body)
    return Check.GOOD if int(found[1]) == should else Check.WRONG, body, should


def numbers(text: str) -> list[float]:
    """Return the numbers at the beginning of the text, as repeated ``strtof`` finds them."""
    found, at = [], 0
    while match := _NUMBER.match(text, at):
        found.append(float(match[1]))
        at = match.end()
    return found


def padded(text: str, count: int) -> list[float]:
    """Return the first ``count`` numbers of the text; a missing one is 0, as with ``strtof``."""
    return (numbers(text) + [0.0] * count)[:count]


class LineReader:
    """Splits characters into lines.

    If a line fills the buffer, the next character replaces all characters in the buffer.
    """

    def __init__(self) -> None:
        self._held = bytearray()

    def clear(self) -> None:
        """Discard an incomplete line."""
        self._held.clear()

    def feed(self, data: bytes) -> list[str]:
        """Return the lines that ``data`` completes, without line ends and without empty lines."""
        lines = []
        for byte in data:
            if byte in b"\r\n":
                if self._held:
                    lines.append(self._held.decode("latin-1"))
                self._held.clear()
                continue
            if len(self._held) >= BUFFER:
                self._held.clear()
            self._held.append(byte)
        return lines
