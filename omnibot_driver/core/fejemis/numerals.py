# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Numbers that can be sent safely: a checksum detects the loss of any two of their characters.

No safe line contains two characters whose codes add up to 99, because a checksum does not detect
the loss of both: ``1`` and ``2``, ``0`` and ``3``, ``.`` and ``5``, ``-`` and ``6``. Motion lines
begin with ``rc 2``, so their numbers contain no ``1``.
"""

from bisect import bisect_left, bisect_right
from functools import cache
from typing import Final

SIGNIFICANT: Final = 3
SMALLEST: Final = -4
LARGEST: Final = 4
"""``SMALLEST``, ``LARGEST``: exponents of ten that limit the size of a safe number.

A safe number is at least ``10 ** SMALLEST``, and less than ``10 ** LARGEST``.
"""


@cache
def numerals(*, negative: bool) -> tuple[list[float], list[str]]:
    """Return all safe numbers in rising order, and the text of each number.

    ``negative``: whether the line contains a minus sign. If so, the numbers contain no ``6``: the
    loss of ``-`` and ``6`` is undetected.
    """
    # Each motion line contains a ``2``, so no ``1``; it can contain ``0`` and ``.``, so no ``3`` or
    # ``5``.
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


def nearest(number: float, *, negative: bool) -> tuple[float, str]:
    """Return the safe number nearest to a positive ``number``, and the text of the safe number.

    The checksum of a line detects the loss of any two characters of its safe numbers.
    """
    numbers, texts = numerals(negative=negative)
    at = bisect_left(numbers, number)
    if at == len(numbers) or (at > 0 and number - numbers[at - 1] < numbers[at] - number):
        at -= 1
    return numbers[at], texts[at]


def beside(number: float, *, negative: bool) -> list[tuple[float, str]]:
    """Return the safe numbers just below and just above ``number``, each with its text.

    The checksum of a line detects the loss of any two characters of its safe numbers.
    """
    numbers, texts = numerals(negative=negative)
    at = bisect_left(numbers, number)
    part = slice(max(0, at - 1), at + 1)
    return list(zip(numbers[part], texts[part], strict=True))


def between(least: float, most: float, *, negative: bool) -> list[tuple[float, str]]:
    """Return the safe numbers from ``least`` to ``most``, each with its text.

    The checksum of a line detects the loss of any two characters of its safe numbers.
    """
    numbers, texts = numerals(negative=negative)
    part = slice(bisect_left(numbers, least), bisect_right(numbers, most))
    return list(zip(numbers[part], texts[part], strict=True))


def _written(mantissa: str, power: int) -> str:
    """Return the text of a number with the three digits ``mantissa``.

    ``power``: power of ten of the first digit.
    """
    if power >= SIGNIFICANT - 1:
        return mantissa + "0" * (power - SIGNIFICANT + 1)
    if power >= 0:
        return f"{mantissa[: power + 1]}.{mantissa[power + 1 :]}"
    return "." + "0" * (-power - 1) + mantissa
