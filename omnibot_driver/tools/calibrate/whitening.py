# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The correlation of successive residuals, and the matrix that removes this correlation.

This module knows residuals; it does not know the model that they come from.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular, toeplitz

Column = NDArray[np.float64]


def correlation(rows: Sequence[Column], lags: int) -> Column:
    """Return a robust estimate of the residuals' autocorrelation, for lags up to ``lags``.

    ``rows``: rows of successive residuals. With a single lag, its value is limited to the range
    from -0.5 to 0. With several lags, the values are reduced, more at larger lags.
    """
    every = np.concatenate(rows)
    spread = 3 * 1.4826 * float(np.median(np.abs(every)))
    rows = [np.clip(row, -spread, spread) for row in rows]
    lags = min(lags, min(map(len, rows)) - 1)
    products = np.array(
        [
            sum(float(np.dot(row[lag:], row[: len(row) - lag])) for row in rows)
            for lag in range(lags + 1)
        ]
    )
    found = products / max(products[0], 1e-12)
    if lags == 1:
        # -0.5: all errors come from displaced encoder marks. 0: all errors are independent.
        found[1] = np.clip(found[1], -0.499, 0.0)
        return np.asarray(found)
    return np.asarray(found * (1.0 - np.arange(lags + 1) / (lags + 1)))


def whitener(of_lags: Column, length: int) -> Column:
    """Return the matrix that removes an autocorrelation from a row of ``length`` residuals.

    For a shorter row, use the upper left part of the matrix. ``of_lags``: the autocorrelation from
    lag 0 on.
    """
    column = np.zeros(length)
    column[: len(of_lags)] = of_lags[:length]
    matrix = toeplitz(column)
    matrix[np.diag_indices(length)] += 1e-4
    factor = cholesky(matrix, lower=True)
    return np.asarray(solve_triangular(factor, np.eye(length), lower=True))
