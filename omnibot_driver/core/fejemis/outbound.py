# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Lines to the boards, written so that damage cannot turn one command into another.

A sum modulo 99 does not detect two lost characters whose codes add up to 99 or 198 (`0` and `3`,
`1` and `2`, `.` and `5`, `-` and `6`). A motion line must not contain both characters of a pair,
see `motion_lines.py`. Two more kinds of damage are detected or not depending on the value of the
sum, so the digits of a motion line are chosen to get a suitable sum:

* A lost line end joins two lines. The joined line passes the check if one more character is lost,
  whose code equals the sum of the second line with its prefix. So this sum must not be the code of
  a character in numbers, nor of the ``;`` (without it, the digits of the sum would continue the
  last number of the first line). If a line has such a sum and its digits cannot be chosen, the
  driver first sends an empty line, which the boards ignore.
* A lost digit of the sum leaves a sum that is correct only if a certain character is lost as well.
  So this character must not occur in numbers.

Characters are never added to a line itself: a board may compare the complete line with ``stop``.
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
    """Return the bytes of one line with its line end, and with its sum in front if ``sums``."""
    if not sums:
        return text + b"\n"
    before = b"" if robust(text) else b"\n"
    return before + with_sum(text) + b"\n"


def lines(*texts: bytes, sums: bool) -> bytes:
    """Return the bytes of several lines in order, each as ``line`` makes it."""
    return b"".join([line(text, sums=sums) for text in texts])


def harmless(text: str) -> bool:
    """Return whether the loss of any two characters changes the text's sum."""
    codes = text.encode("ascii")
    return not any(
        one in codes and other in codes and (one != other or codes.count(one) > 1)
        for one, other in _COMPLEMENTS
    )


def robust(text: bytes) -> bool:
    """Return whether a lost character is detected even if a line end or sum digit is lost too."""
    total = sum_of(text)
    tens, ones = divmod(total, 10)
    as_second = (ord(";") + 2 * ord("0") + tens + ones + total - 1) % MODULUS
    without_tens, without_ones = (total - ones) % MODULUS, (total - tens) % MODULUS
    return as_second != ord(";") and not {as_second, without_tens, without_ones} & IN_NUMBERS
