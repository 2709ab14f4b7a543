# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Find the positions of an encoder's marks from several records of a wheel.

A *mark* is a place on the encoder's disc at which the board counts a tick. Uneven marks cause
errors in the times between ticks, which repeat in each turn.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Column = NDArray[np.float64]

ROUNDS: Final = 4
LARGEST: Final = 0.5
"""Largest plausible relative error of a time between ticks. A larger error shows a missed edge of
the encoder's signal."""
OUTLIER: Final = 4.5
"""Relative error of a time between ticks, in standard deviations, above which the time is ignored.
The standard deviation is estimated from the median magnitude of all errors."""
EXPLAINED: Final = 0.4
"""Smallest fraction of the variance that fitted marks must explain. For evenly spaced marks, the
fraction is below 0.2 (test with three records of two turns each)."""


@dataclass(frozen=True, slots=True)
class Marks:
    """The marks of an encoder.

    ``steps``: for each mark, the distance to the next mark, as a relative difference from the mean
    distance.
    """

    steps: Column

    @property
    def places(self) -> Column:
        """Displacement of each mark from its evenly spaced position, in ticks."""
        places = np.concatenate(([0.0], np.cumsum(self.steps)[:-1]))
        return np.asarray(places - places.mean())

    def first(self, off: Column) -> int:
        """Return the number of the mark on the encoder's disc at which a record begins.

        Marks are numbered from 0. ``off``: relative errors of the record's times between ticks.
        """
        return _first(np.clip(off, -LARGEST, LARGEST), self.steps)

    def expected(self, first: int, count: int) -> Column:
        """Return the relative errors that the marks cause in the times between successive ticks.

        ``first``: number of the mark at which the first of these times begins. ``count``: how many
        of these times there are.
        """
        return np.asarray(self.steps[(first + np.arange(count)) % len(self.steps)])


def marks_in(rows: Sequence[Column], marks: int) -> Marks | None:
    """Return the marks that explain the records' errors, or None if no pattern repeats each turn.

    * ``rows``: for each record, the relative errors of its times between ticks, NaN if unknown.
    * ``marks``: number of marks on the disc.
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
    """Return the number of the mark at which a record begins, by the best fit to ``steps``.

    ``row``: relative errors of the record's times between ticks. ``steps``: relative errors of the
    distances from each mark to the next.
    """
    marks = len(steps)
    turn = np.bincount(np.arange(len(row)) % marks, weights=np.nan_to_num(row), minlength=marks)
    turned = np.arange(marks)[:, None] + np.arange(marks)
    return int(np.argmax(steps[turned % marks] @ turn))


def _steps(rows: Sequence[Column], firsts: Sequence[int], marks: int) -> Column:
    """Return the relative error of the distance from each mark of the encoder to the next one.

    * ``rows``: for each record of ticks, the relative errors of the times between marks.
    * ``firsts``: for each record, the number of its first mark.
    """
    of = np.concatenate(
        [(first + np.arange(len(row))) % marks for row, first in _both(rows, firsts)]
    )
    off = np.concatenate(list(rows))
    of, off = of[np.isfinite(off)], off[np.isfinite(off)]
    # All times from the same mark to the next cover the same distance.
    steps = np.array(
        [np.median(off[of == mark]) if np.any(of == mark) else 0.0 for mark in range(marks)]
    )
    return np.asarray(steps - steps.mean())


def _both(rows: Sequence[Column], firsts: Sequence[int]) -> "zip[tuple[Column, int]]":
    return zip(rows, firsts, strict=True)
