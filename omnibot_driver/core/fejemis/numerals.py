# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Numbers that can be written without any two digits whose loss a sum does not see.

With the source ``2`` in the line a number has no ``1``; of ``0`` and ``3`` it has no ``3``; with a
point no ``5``; with a minus sign no ``6``. So there are gaps, of which the largest is from 1 to 2.
"""

from bisect import bisect_left, bisect_right
from functools import cache
from typing import Final

SIGNIFICANT: Final = 3
SMALLEST: Final = -4
LARGEST: Final = 4
"""Powers of ten."""


@cache
def numerals(*, negative: bool) -> tuple[list[float], list[str]]:
    """All of them from 0.0001 to 10000, in order. ``negative``: a minus sign is in the line."""
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
    """The nearest one to a positive number; with ``down`` none above it, where there is one."""
    numbers, texts = numerals(negative=negative)
    at = bisect_left(numbers, number)
    if at == len(numbers) or (at > 0 and (down or number - numbers[at - 1] < numbers[at] - number)):
        at -= 1 if at == len(numbers) or numbers[at] != number else 0
    return numbers[at], texts[at]


def between(least: float, most: float, *, negative: bool) -> list[tuple[float, str]]:
    """Those in this range."""
    numbers, texts = numerals(negative=negative)
    part = slice(bisect_left(numbers, least), bisect_right(numbers, most))
    return list(zip(numbers[part], texts[part], strict=True))


def _written(mantissa: str, power: int) -> str:
    """Three digits, the first of which has this power of ten."""
    if power >= SIGNIFICANT - 1:
        return mantissa + "0" * (power - SIGNIFICANT + 1)
    if power >= 0:
        return f"{mantissa[: power + 1]}.{mantissa[power + 1 :]}"
    return "." + "0" * (-power - 1) + mantissa
