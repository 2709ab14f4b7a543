# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Numbers that can be sent safely: a checksum detects if any two of their characters are lost.

A checksum does not detect the loss of both ``1`` and ``2``, ``0`` and ``3``, ``.`` and ``5``, or
``-`` and ``6``. Each motion line already contains a ``2``, the source of the command. So the
numbers never contain ``1``. They do not contain ``3`` or ``5`` either, and no ``6`` if the line has
a minus sign.

So there are gaps between the numbers. The largest gaps lie between 1 and 2 times a power of ten:
between .0999 and .200, for example.
"""

from bisect import bisect_left, bisect_right
from functools import cache
from typing import Final

SIGNIFICANT: Final = 3
SMALLEST: Final = -4
LARGEST: Final = 4
"""``SMALLEST``, ``LARGEST``: limits of the numbers, as powers of ten.

The first digit of a number counts 10**p, where p is at least ``SMALLEST`` and less than
``LARGEST``.
"""


@cache
def numerals(*, negative: bool) -> tuple[list[float], list[str]]:
    """Return all numbers from 0.0001 to 10000 that can be sent safely, in rising order.

    The texts of the numbers are returned too. ``negative``: whether the line has a minus sign. The
    numbers then contain no ``6``.
    """
    digits = "024789" if negative else "0246789"
    mantissas = [
        first + second + third for first in digits[1:] for second in digits for third in digits
    ]
    found = {}
    for power in range(SMALLEST, LARGEST):
        for mantissa in mantissas:
            text = _written(mantissa, power)
            found[float(text)] = text
    numbers = sorted(found)
    return numbers, [found[number] for number in numbers]


def nearest(number: float, *, negative: bool, down: bool = False) -> tuple[float, str]:
    """Return the number of ``numerals`` that is nearest to a positive ``number``, with its text.

    ``down``: take the nearest one that is not larger than ``number``, if there is one.
    """
    numbers, texts = numerals(negative=negative)
    at = bisect_left(numbers, number)
    if at == len(numbers) or (at > 0 and (down or number - numbers[at - 1] < numbers[at] - number)):
        at -= 1 if at == len(numbers) or numbers[at] != number else 0
    return numbers[at], texts[at]


def beside(number: float, *, negative: bool) -> list[tuple[float, str]]:
    """Return the numbers of ``numerals`` just below and just above ``number``, with their texts."""
    numbers, texts = numerals(negative=negative)
    at = bisect_left(numbers, number)
    part = slice(max(0, at - 1), at + 1)
    return list(zip(numbers[part], texts[part], strict=True))


def between(least: float, most: float, *, negative: bool) -> list[tuple[float, str]]:
    """Return the numbers of ``numerals`` from ``least`` to ``most``, with their texts."""
    numbers, texts = numerals(negative=negative)
    part = slice(bisect_left(numbers, least), bisect_right(numbers, most))
    return list(zip(numbers[part], texts[part], strict=True))


def _written(mantissa: str, power: int) -> str:
    """Return the text of a number with three digits; ``power``: the first digit's power of ten."""
    if power >= SIGNIFICANT - 1:
        return mantissa + "0" * (power - SIGNIFICANT + 1)
    if power >= 0:
        return f"{mantissa[: power + 1]}.{mantissa[power + 1 :]}"
    return "." + "0" * (-power - 1) + mantissa
