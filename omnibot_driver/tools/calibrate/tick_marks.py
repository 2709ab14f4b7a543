# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The places of an encoder's marks, from several records of the same wheel. Pure calculation.

A disc has the same marks in each turn, so what they make of the times between ticks comes again,
in each record with another mark first. Knows how far the times are off those of even marks; it does
not know how the wheel moved.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Column = NDArray[np.float64]

ROUNDS: Final = 4
LARGEST: Final = 0.5
"""A time that is off by more than this part does not tell where a mark is: an edge was missed."""
OUTLIER: Final = 4.5
"""Standard deviations; beyond them an edge was late."""
EXPLAINED: Final = 0.4
"""Part of the variance that marks must explain to be believed. By chance they explain what they
have parameters for: less than a fifth with three records of two turns."""


@dataclass(frozen=True, slots=True)
class Marks:
    """``steps``: how much longer each way from mark to mark is than their mean, as a part of it."""

    steps: Column

    @property
    def places(self) -> Column:
        """How far each mark is off its place, in ticks."""
        places = np.concatenate(([0.0], np.cumsum(self.steps)[:-1]))
        return np.asarray(places - places.mean())

    def first(self, off: Column) -> int:
        """The step that the first of these times belongs to."""
        return _first(np.clip(off, -LARGEST, LARGEST), self.steps)

    def expected(self, first: int, count: int) -> Column:
        """What the marks make of ``count`` times from step ``first`` on, as a part of each."""
        return np.asarray(self.steps[(first + np.arange(count)) % len(self.steps)])


def marks_in(rows: Sequence[Column], marks: int) -> Marks | None:
    """``rows``: of each record, how much longer each time was than with even marks, as a part; nan
    where that is not known.

    None where the times are not off in the same way in each turn.
    """
    spread = 1.4826 * float(np.nanmedian(np.abs(np.concatenate(list(rows)))))
    limit = min(LARGEST, OUTLIER * spread)
    rows = [np.where(np.abs(row) <= limit, row, np.nan) for row in rows]
    total = float(sum(np.nansum(row * row) for row in rows))
    if total == 0.0:
        return None
    steps = _steps([max(rows, key=len)], [0], marks)
    firsts: list[int] = []
    for _ in range(ROUNDS):
        firsts = [_first(row, steps) for row in rows]
        steps = _steps(rows, firsts, marks)
    found = Marks(steps)
    rest = sum(
        float(np.nansum((row - found.expected(first, len(row))) ** 2))
        for row, first in zip(rows, firsts, strict=True)
    )
    return found if rest < (1.0 - EXPLAINED) * total else None


def _first(row: Column, steps: Column) -> int:
    """The step with which this row begins: where both agree best."""
    marks = len(steps)
    turn = np.bincount(np.arange(len(row)) % marks, weights=np.nan_to_num(row), minlength=marks)
    turned = np.arange(marks)[:, None] + np.arange(marks)
    return int(np.argmax(steps[turned % marks] @ turn))


def _steps(rows: Sequence[Column], firsts: Sequence[int], marks: int) -> Column:
    """The median of each step; their mean is zero."""
    of = np.concatenate(
        [(first + np.arange(len(row))) % marks for row, first in _both(rows, firsts)]
    )
    off = np.concatenate(list(rows))
    of, off = of[np.isfinite(off)], off[np.isfinite(off)]
    steps = np.array(
        [np.median(off[of == mark]) if np.any(of == mark) else 0.0 for mark in range(marks)]
    )
    return np.asarray(steps - steps.mean())


def _both(rows: Sequence[Column], firsts: Sequence[int]) -> "zip[tuple[Column, int]]":
    return zip(rows, firsts, strict=True)
