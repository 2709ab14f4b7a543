# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Lines to the boards, such that damage on the way makes no other command of a command.

A sum mod 99 does not see two lost characters whose codes add up to 99 or 198 (`0` and `3`, `1` and
`2`, `.` and `5`, `-` and `6`): a motion line must not have both of a pair, see `motion_lines.py`.
Spaces at the end of every line choose its sum, against two more kinds of damage:

* A lost line end makes one line of two. It passes if the sum of the second, with its prefix, equals
  what else was lost: so no such sum may be the code of a character of a number.
* A lost digit of the sum leaves one that fits the rest only if the right character is lost too.

Without sums nothing of this helps: a damaged number is obeyed until the next line comes.
"""

from functools import lru_cache
from typing import Final

from omnibot_driver.core.fejemis.sums import MODULUS, sum_of, with_sum

IN_NUMBERS: Final = frozenset(b" -.0123456789")
_COMPLEMENTS: Final = tuple(
    (one, other)
    for one in sorted(IN_NUMBERS)
    for other in sorted(IN_NUMBERS)
    if one <= other and (one + other) % MODULUS == 0
)
LONGEST_PADDING: Final = 98
"""Spaces with which every sum occurs."""


@lru_cache(maxsize=1024)
def line(text: bytes, *, sums: bool) -> bytes:
    """The characters of one line, to its end."""
    if not sums:
        return text + b"\n"
    for spaces in range(LONGEST_PADDING + 1):
        padded = text + spaces * b" "
        if _robust(sum_of(padded)):
            return with_sum(padded) + b"\n"
    return with_sum(text) + b"\n"


def lines(*texts: bytes, sums: bool) -> bytes:
    """Several, one after the other."""
    return b"".join([line(text, sums=sums) for text in texts])


def harmless(text: str) -> bool:
    """Whether no two characters of it can be lost without changing its sum."""
    codes = text.encode("ascii")
    return not any(
        one in codes and other in codes and (one != other or codes.count(one) > 1)
        for one, other in _COMPLEMENTS
    )


def _robust(total: int) -> bool:
    tens, ones = divmod(total, 10)
    as_second = (ord(";") + 2 * ord("0") + tens + ones + total - 1) % MODULUS
    without_tens, without_ones = (total - ones) % MODULUS, (total - tens) % MODULUS
    return not {as_second, without_tens, without_ones} & IN_NUMBERS
