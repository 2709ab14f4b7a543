# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A least-squares fit of a plant to the times between encoder ticks of several starts.

* *Plant*: the motor with its wheel.
* *Mark*: a place on the encoder's disc at which the board counts a tick, or misses it.
* *Record*: the times between the ticks of one start.

This module does not know files, and does not choose the plant's order.
"""

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.sparse import csr_matrix

from omnibot_driver.tools.calibrate.tick_marks import Marks
from omnibot_driver.tools.calibrate.whitening import correlation, whitener

Column = NDArray[np.float64]

SIGMA: Final = 0.1
"""Assumed relative noise of a time between ticks, until the encoder's marks are fitted."""
SHARPEST: Final = 0.002
"""Least assumed relative noise of a time between ticks. There is always some noise, because the
board reports times in steps of 0.1 ms."""
SHORTEST_S: Final = 0.005
LONGEST_S: Final = 5.0
"""Longest allowed sum of both time constants, in s."""
GRID: Final = 1500
STARTS_S: Final = (0.1, 0.5)
"""Starting values for the sum of both time constants, in s. There is one search for each value."""
RATIOS: Final = (0.15, 0.4, 0.8)
"""Starting values for the ratio of the fast to the slow time constant. A search that starts at 1
would stay there."""
LATEST_S: Final = 2.0
"""Longest allowed time from the start of the wheel to its first tick, in s."""
MOST_OFF: Final = 0.4
"""Largest allowed displacement of a mark from its evenly spaced position, in ticks."""
LAGS: Final = 60
"""Largest distance between two residuals, in ticks, at which their correlation is considered. The
slow changes of the load correlate distant residuals."""
MISSED: Final = 0.42
"""Limit for the relative errors of two successive times between encoder ticks, added up. The sum is
larger if the board has missed a mark of the encoder in the first time."""
SURE_TICKS: Final = 4
"""Number of ticks at the start of a record that are not searched for missed marks, because the
wheel is still so slow that the board notices every mark."""
OUTLIER: Final = 5.0
"""Error of a time between ticks, in standard deviations, above which the time is not used."""
FEWEST_RECORDS: Final = 6
"""Least number of records for which the scatter between records is used to estimate errors."""


def turned(times_s: Column, slow_s: float, fast_s: float) -> Column:
    """Return the distance since a step of the duty at time 0, divided by the final speed, in s."""
    slow = np.exp(-times_s / slow_s)
    if fast_s < 1e-4 * slow_s:
        return np.asarray(times_s - slow_s * (1 - slow))
    if abs(slow_s - fast_s) < 1e-3 * slow_s:
        return np.asarray(times_s - 2 * slow_s + (2 * slow_s + times_s) * slow)
    fast = np.exp(-times_s / fast_s)
    rest = (slow_s**2 * slow - fast_s**2 * fast) / (slow_s - fast_s)
    return np.asarray(times_s - slow_s - fast_s + rest)


def constants(values: Column, order: int) -> tuple[float, float]:
    """Return the slow and the fast time constant, in s, from the values that a ``Search`` fits.

    The values contain the sum and the ratio of the constants, because exchanged constants describe
    the same plant.
    """
    total = math.exp(values[1])
    ratio = float(values[2]) if order == 2 else 0.0
    return total / (1 + ratio), total * ratio / (1 + ratio)


class Search:
    """A search for the values of a plant.

    A mark is a place on the encoder's disc at which the board counts a tick. ``intervals``: for
    each record, the times between ticks in s.

    The array of values has, in this order:

    * log of the final rate (ticks/s)
    * log of the sum of both time constants (s)
    * ratio of the time constants, if the order is 2
    * for each record, the time from the wheel's start to its first tick (s)
    * offset of each mark from its evenly spaced position (ticks), only while the marks are fitted
    """

    def __init__(self, intervals: Sequence[Column], order: int = 2) -> None:
        self.order = order
        self._lengths = [len(one) for one in intervals]
        self._measured = np.concatenate(intervals)
        self._rate = 1.0 / float(np.median([np.median(one[len(one) // 2 :]) for one in intervals]))
        self._counts = [np.arange(length + 1) for length in self._lengths]
        self._marks = 0
        self._first_marks = [0] * len(intervals)
        self._off = np.zeros(1)
        self._sigma = SIGMA
        self._whitener: Column | None = None
        self._good = np.ones(len(self._measured), dtype=bool)

    def roughly(self) -> Column:
        """Return first estimates of all values.

        These first estimates assume a plant of second order, evenly spaced marks and independent
        noise.
        """
        records = len(self._lengths)
        starts = []
        for total_s in STARTS_S:
            # The values have the time of the first mark, not its distance from the start. The
            # distance would be too small for the search: just after the start, it grows with the
            # cube of the time.
            begins_s = [(0.5 * total_s**2 / self._rate) ** (1 / 3)] * records
            starts.append(np.array([math.log(self._rate), math.log(total_s), 0.3, *begins_s]))
        return self._best(starts)

    def closely(self, values: Column) -> Column:
        """Repeat the search with several ratios of the time constants, to avoid a local optimum."""
        return self._best([np.array([*values[:2], ratio, *values[3:]]) for ratio in RATIOS])

    def first_order(self, values: Column) -> Column:
        """Set ``order`` to 1, and search for a plant of first order.

        ``values``: the values of a plant of second order, from which the search starts.
        """
        self.order = 1
        return self._best([np.array([*values[:2], *values[3:]])])

    def off(self, values: Column) -> list[Column]:
        """Return, for each record, the relative errors of the times from each mark to the next.

        The errors are relative to the times that ``values`` predict for evenly spaced marks. Next
        to a missed mark, they are NaN.
        """
        found = []
        for row, count in zip(self._off_even(values), self._counts, strict=True):
            alone = np.diff(count) == 1
            one = np.full(count[-1], np.nan)
            one[count[:-1][alone]] = row[alone]
            found.append(one)
        return found

    def find_missed(self, values: Column) -> bool:
        """Find the marks that the board missed; return whether it missed any.

        In all later searches, a time with a missed mark in it counts as two distances between
        marks.
        """
        any_missed = False
        for place, row in enumerate(self._off_even(values)):
            # If the board missed a mark, the interval is twice as long as expected, so ``both`` is
            # about 1, or smaller if the board's clock loses up to 6 ms. If the board noticed a mark
            # late, the next interval is too short by the same amount, so ``both`` is near 0.
            both = row + np.append(row[1:], 0.0)
            missed = (row > MISSED / 2) & (both > MISSED)
            missed[1:] &= ~missed[:-1]
            missed[:SURE_TICKS] = False
            self._counts[place] = np.append(0, np.cumsum(1 + missed))
            any_missed |= bool(missed.any())
        return any_missed

    def _off_even(self, values: Column) -> list[Column]:
        return self._rows(self._measured / self._told(values, np.zeros(1)) - 1.0)

    def with_marks(self, marks: Marks, values: Column) -> Column:
        """Fit the plant and the positions of the encoder's marks; return the plant's values.

        All later searches use the fitted positions. ``marks``: the positions from which the fit
        starts.
        """
        self._marks, own = len(marks.steps), len(values)
        self._first_marks = [marks.first(row) for row in self.off(values)]
        values = np.concatenate((values, marks.places))
        self._sigma = max(SHARPEST, _spread(self._relative(values)))
        values = self._best([values])
        self._marks, self._off = 0, values[own:]
        return np.asarray(values[:own])

    def correlate(self, values: Column) -> None:
        """Measure the correlation of the residuals, and remove it in all later searches.

        ``values``: the values of the plant. The correlation comes from the load, and from uneven
        marks that are not fitted yet.
        """
        every = self._relative(values)
        lags = 1
        if len(self._off) > 1:
            lags, self._good = LAGS, np.abs(every) < OUTLIER * _spread(every)
        self._whitener = whitener(correlation(self._rows(every), lags), max(self._lengths))

    def left(self, values: Column) -> Column:
        """Return the relative residuals for ``values``, without outliers.

        If ``correlate`` has measured the correlation of the residuals, this correlation is removed.
        """
        left = self._residuals(values) * self._sigma
        return np.asarray(left[np.abs(left) < 5 * max(_spread(left), 1e-3)])

    def covariance(self, values: Column) -> Column:
        """Return the covariance of the values that all records share.

        The covariance follows from the residuals. It is increased if the results of the records
        differ by more than the residuals predict.
        """
        own = 1 + self.order
        found = self._search(values)
        jacobian = np.asarray(found.jac.todense())
        inverse = np.linalg.pinv(jacobian.T @ jacobian)
        rms = float(np.sqrt(np.mean(self.left(values) ** 2))) / self._sigma
        covariance = (inverse * rms**2)[:own, :own]
        records = len(self._lengths)
        if records < FEWEST_RECORDS:
            return np.asarray(covariance)
        rows = zip(self._rows(jacobian), self._rows(self._residuals(values)), strict=True)
        pulls = np.array([row.T @ np.clip(left, -5 * rms, 5 * rms) for row, left in rows])
        scatter = (inverse @ (pulls.T @ pulls) @ inverse)[:own, :own] * records / (records - 1)
        grown = np.sqrt(np.maximum(np.diag(scatter) / np.diag(covariance), 1.0))
        return np.asarray(covariance * np.outer(grown, grown))

    def _best(self, starts: Sequence[Column]) -> Column:
        found = min((self._search(start) for start in starts), key=_cost)
        return np.asarray(found.x)

    def _search(self, start: Column) -> Any:
        rate, records = self._rate, len(self._lengths)
        ratio = self.order - 1
        low = [math.log(rate / 2), math.log(SHORTEST_S), *[0.02] * ratio, *[0.0] * records]
        high = [math.log(2 * rate), math.log(LONGEST_S), *[1.0] * ratio, *[LATEST_S] * records]
        low += [-MOST_OFF] * self._marks
        high += [MOST_OFF] * self._marks
        return least_squares(
            self._residuals,
            start,
            bounds=(low, high),
            loss="soft_l1",
            x_scale=0.1,
            tr_solver="lsmr",  # avoids a matrix decomposition, for which BLAS starts threads
            jac_sparsity=self._sparsity(),
            max_nfev=40,
            ftol=1e-7,
            xtol=1e-6,
        )

    def _sparsity(self) -> csr_matrix:
        """Return the Jacobian's sparsity pattern: a row for each time, a column for each value."""
        own, records, times = 1 + self.order, len(self._lengths), len(self._measured)
        pattern = np.zeros((times, own + records + self._marks))
        pattern[:, :own] = 1.0
        row = np.arange(times)
        pattern[row, own + np.repeat(np.arange(records), self._lengths)] = 1.0
        if self._marks:
            for end in (slice(None, -1), slice(1, None)):
                marks = np.concatenate(
                    [
                        one + count[end]
                        for one, count in zip(self._first_marks, self._counts, strict=True)
                    ]
                )
                pattern[row, own + records + marks % self._marks] = 1.0
        return csr_matrix(pattern)

    def _relative(self, values: Column) -> Column:
        return np.asarray(self._measured / self._told(values) - 1.0)

    def _residuals(self, values: Column) -> Column:
        found = np.where(self._good, self._relative(values) / self._sigma, 0.0)
        if self._whitener is None:
            return found
        rows = self._rows(found)
        return np.concatenate([self._whitener[: len(row), : len(row)] @ row for row in rows])

    def _rows(self, of_all: Column) -> list[Column]:
        """Split an array into one array for each record.

        The array has one row for each time between ticks, record after record.
        """
        return np.split(of_all, np.cumsum(self._lengths)[:-1])

    def _told(self, values: Column, off: Column | None = None) -> Column:
        """Return the times between ticks that ``values`` predict, in s, record after record.

        ``off``: offset of each mark from its evenly spaced position, in ticks. None means the
        offsets in ``values``, or those of an earlier fit if ``values`` has none.
        """
        order, records = self.order, len(self._lengths)
        rate, (slow_s, fast_s) = math.exp(values[0]), constants(values, order)
        last_s = (max(self._lengths) + 5) / rate + 2 * (slow_s + fast_s)
        grid_s = last_s * np.linspace(0.0, 1.0, GRID) ** 2  # closer points near the start
        way = rate * turned(grid_s, slow_s, fast_s)
        begins_s = values[1 + order : 1 + order + records]
        if off is None:
            off = values[1 + order + records :] if self._marks else self._off
        told = []
        for begin_s, first, count in zip(begins_s, self._first_marks, self._counts, strict=True):
            marks = off[(first + count) % len(off)]
            places = rate * turned(np.array([begin_s]), slow_s, fast_s) + count + marks - marks[0]
            told.append(np.diff(np.interp(places, way, grid_s)))
        return np.asarray(np.maximum(np.concatenate(told), 1e-6))


def _spread(errors: Column) -> float:
    """Return the standard deviation of errors, estimated from their median magnitude."""
    return 1.4826 * float(np.median(np.abs(errors)))


def _cost(found: Any) -> float:
    return float(found.cost)
