# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Lines to the boards, such that damage on the way makes no other command of a command.

A sum mod 99 does not see two lost characters whose codes add up to 99 or 198 (`0` and `3`, `1` and
`2`, `.` and `5`, `-` and `6`): a motion line must not have both of a pair, see `motion_lines.py`.
Two more kinds of damage depend on the sum, so the digits of a motion line are chosen by that too:

* A lost line end makes one line of two. It passes if the sum of the second, with its prefix, equals
  what else was lost: so no such sum may be the code of a character of a number. Other lines with
  such a sum begin with an empty one, which no board obeys.
* A lost digit of the sum leaves one that fits the rest only if the right character is lost too.

Nothing is ever added to a line itself: a board may compare ``stop`` with all of the line.
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


@lru_cache(maxsize=1024)
def line(text: bytes, *, sums: bool) -> bytes:
    """The characters of one line, to its end."""
    if not sums:
        return text + b"\n"
    before = b"" if robust(text) else b"\n"
    return before + with_sum(text) + b"\n"


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


def robust(text: bytes) -> bool:
    """Whether its sum stands for no character of a number that is lost with another."""
    total = sum_of(text)
    tens, ones = divmod(total, 10)
    as_second = (ord(";") + 2 * ord("0") + tens + ones + total - 1) % MODULUS
    without_tens, without_ones = (total - ones) % MODULUS, (total - tens) % MODULUS
    return not {as_second, without_tens, without_ones} & IN_NUMBERS
