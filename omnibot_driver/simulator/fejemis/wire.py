# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Lines of text as a Teensy reads and writes them; from the manual and its hosts, its own codec.

A line begins with ``;NN`` in firmware that has sums: 1 plus the remainder by 99 of the sum of all
later characters from the space on. Numbers are read as C's ``strtof`` reads them. Knows no meaning
of a command.
"""

import re
from enum import Enum

BUFFER = 200
"""Characters of a line that fit; a longer one is cut into several."""

_NUMBER = re.compile(r"[ \t]*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)")
_PREFIX = re.compile(r";(\d\d)")


class Check(Enum):
    """What the sum says of a line."""

    GOOD = "good"
    WRONG = "wrong"
    ABSENT = "absent"


def sum_of(text: str) -> int:
    """1 to 99."""
    return sum(ord(character) for character in text if character >= " ") % 99 + 1


def line(text: str, *, sums: bool, carriage_return: bool) -> bytes:
    """One line as it goes over the wire."""
    prefix = f";{sum_of(text):02d}" if sums else ""
    end = "\r\n" if carriage_return else "\n"
    return f"{prefix}{text}{end}".encode("latin-1")


def checked(text: str) -> tuple[Check, str, int]:
    """What the sum says, the line without it, and the number that it should have been."""
    found = _PREFIX.match(text)
    if found is None:
        return Check.ABSENT, text, 0
    body = text[found.end() :]
    should = sum_of(body)
    return Check.GOOD if int(found[1]) == should else Check.WRONG, body, should


def numbers(text: str) -> list[float]:
    """All that ``strtof`` finds, one after the other, up to the first text that is not a number."""
    found, at = [], 0
    while match := _NUMBER.match(text, at):
        found.append(float(match[1]))
        at = match.end()
    return found


class LineReader:
    """Characters to lines; those that do not fit the buffer begin a line of their own."""

    def __init__(self) -> None:
        self._held = bytearray()

    def clear(self) -> None:
        """Nothing was received."""
        self._held.clear()

    def feed(self, data: bytes) -> list[str]:
        """The lines that these bytes complete, without their ends; empty ones are left out."""
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
