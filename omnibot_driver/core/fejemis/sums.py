# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Adds the checksum ``;NN`` in front of a line, and checks it.

The checksum does not detect:

* 1 in 99 random changes.
* The loss of a ``c``, whose code is 99.
* The loss of two characters whose codes add up to 99 or 198.
"""

import re
from functools import lru_cache
from typing import Final

MODULUS: Final = 99
IN_NUMBERS: Final = frozenset(b" -.0123456789")
_CONTROL: Final = bytes(range(0x20))
_SUMMED: Final = re.compile(rb";([0-9]{2})(.*)", re.DOTALL).fullmatch


def sum_of(text: bytes) -> int:
    """Return the checksum, 1..99, of a line's text without its ``;NN``."""
    return sum(text.translate(None, _CONTROL)) % MODULUS + 1


def with_sum(text: bytes) -> bytes:
    """Return the text with its checksum, ``;NN``, in front; the line end is not added."""
    return b";%02d%s" % (sum_of(text), text)


def without_sum(line: bytes) -> tuple[bytes, bool | None]:
    """Return a line's text, and whether the line's checksum is right.

    The second item is None if the line has no checksum.
    """
    if not line.startswith(b";"):
        return line, None
    found = _SUMMED(line)
    if found is None:
        return line, False
    return found[2], int(found[1]) == sum_of(found[2])


@lru_cache(maxsize=1024)
def line(text: bytes, *, sums: bool) -> bytes:
    """Return the bytes of one line with its line end; ``sums``: whether to add the checksum."""
    if not sums:
        return text + b"\n"
    # If damage to the line could be undetected, an empty line comes before it. The boards ignore
    # empty lines. The text itself is not changed: a board may compare it with ``stop``.
    before = b"" if robust(text) else b"\n"
    return before + with_sum(text) + b"\n"


def lines(*texts: bytes, sums: bool) -> bytes:
    """Return the bytes of several lines, with line ends; ``sums``: whether to add checksums."""
    return b"".join([line(text, sums=sums) for text in texts])


def robust(text: bytes) -> bool:
    """Return whether the checksum of ``text`` detects each critical loss of two characters.

    In a critical loss, one character is a line end or a checksum digit, and the other is ``;`` or
    a part of a number.
    """
    # A lost line end joins two lines. Let S be the sum of the second line with its prefix ``;NN``.
    # The board accepts the joined line if a character with the code S is lost too. So S must not be
    # the code of ``;`` or of a character in numbers. If a digit of the checksum is lost, there is
    # one character whose loss makes the damage undetected. It must not occur in numbers.
    total = sum_of(text)
    tens, ones = divmod(total, 10)
    as_second = (ord(";") + 2 * ord("0") + tens + ones + total - 1) % MODULUS
    without_tens, without_ones = (total - ones) % MODULUS, (total - tens) % MODULUS
    return as_second != ord(";") and not {as_second, without_tens, without_ones} & IN_NUMBERS
