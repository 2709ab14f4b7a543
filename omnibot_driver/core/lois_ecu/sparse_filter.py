# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Kalman filter of a few states, in plain numbers, without a matrix library.

Rows of the transition matrix and measurements are given as their non-zero terms, to save time.
"""

from collections.abc import Mapping, Sequence
from typing import Final

Terms = Sequence[tuple[int, float]]
"""Terms of a weighted sum of states: the index of each state and its factor."""

LEAST_VARIANCE: Final = 1e-12


class SparseFilter:
    """Kalman filter. ``mean`` and the symmetric ``covariance`` of all states begin at zero."""

    def __init__(self, states: int) -> None:
        self.mean = [0.0] * states
        self.covariance = [[0.0] * states for _ in range(states)]

    def propagate(self, rows: Mapping[int, Terms]) -> None:
        """Propagate the covariance by one step of the filter. The caller must propagate ``mean``.

        ``rows``: the rows of the transition matrix that differ from the identity matrix.
        """
        half = _applied(rows, self.covariance)
        whole = _applied(rows, [list(column) for column in zip(*half, strict=True)])
        self.covariance = whole

    def disturb(self, terms: Terms, variance: float) -> None:
        """Add an error with the given variance.

        ``terms``: the states that the error changes, each with its factor.
        """
        covariance = self.covariance
        for i, a in terms:
            row = covariance[i]
            for j, b in terms:
                row[j] += variance * a * b

    def forget(self, state: int, mean: float, variance: float) -> None:
        """Set a state to the given mean and variance, uncorrelated with all other states."""
        covariance = self.covariance
        for row in covariance:
            row[state] = 0.0
        covariance[state] = [0.0] * len(covariance)
        covariance[state][state] = variance
        self.mean[state] = mean

    def variance_of(self, terms: Terms) -> float:
        """Return the variance of a weighted sum of states."""
        covariance = self.covariance
        return max(sum(a * b * covariance[i][j] for i, a in terms for j, b in terms), 0.0)

    def measure(self, terms: Terms, residual: float, variance: float) -> None:
        """Correct all states by a measurement of a weighted sum of states.

        ``residual``: measured minus expected value.

        ``variance``: variance of the measurement.
        """
        covariance = self.covariance
        along = [sum(factor * row[state] for state, factor in terms) for row in covariance]
        total = sum(factor * along[state] for state, factor in terms) + variance
        if total < LEAST_VARIANCE:
            return
        gain = [number / total for number in along]
        self.mean = [old + part * residual for old, part in zip(self.mean, gain, strict=True)]
        self.covariance = [
            [old - part * number for old, number in zip(row, along, strict=True)] if part else row
            for row, part in zip(covariance, gain, strict=True)
        ]


def _applied(rows: Mapping[int, Terms], matrix: list[list[float]]) -> list[list[float]]:
    result = list(matrix)
    for state, terms in rows.items():
        (first, factor), *rest = terms
        new = [factor * number for number in matrix[first]]
        for other, factor in rest:
            new = [old + factor * number for old, number in zip(new, matrix[other], strict=True)]
        result[state] = new
    return result
