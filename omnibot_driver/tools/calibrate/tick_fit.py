# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""From the times between the ticks of wheels that start at full duty to a plant. Pure calculation.

A record begins with the first tick after it was asked for, so when the duty was applied is not in
it: only how the times between ticks become shorter. Dead time cannot be seen so. The plant is of
first or second order, from duty to speed; whichever explains the record better is taken.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky_banded, solve_banded
from scipy.optimize import least_squares

from omnibot_driver.tools.needs import ToolError

Column = NDArray[np.float64]

FEWEST_TICKS: Final = 30
SIGMA: Final = 0.1
"""Relative noise of one time that is expected; what is found is part of the result."""
SHORTEST_S: Final = 0.005
LONGEST_S: Final = 5.0
"""Of a time constant."""
GRID: Final = 1500
STARTS_S: Final = (0.1, 0.5)
"""Of the sum of both time constants."""
RATIOS: Final = (0.15, 0.4, 0.8)
"""Of the fast one to the slow one; at 1 the search would stand still."""


@dataclass(frozen=True, slots=True)
class Plant:
    """Speed in RPM after a step of duty: gain times (duty beyond ``dead_zone_percent``), through
    two lags. ``fast_s`` is 0 for a first order.
    """

    rpm_per_percent: float
    slow_s: float
    fast_s: float
    dead_zone_percent: float = 0.0

    def final_rpm(self, duty_percent: float) -> float:
        """Speed after a long time."""
        return self.rpm_per_percent * max(duty_percent - self.dead_zone_percent, 0.0)


@dataclass(frozen=True, slots=True)
class PlantFit:
    """``final_rpm``: at the duty of the records. Sigmas are scaled by the residuals."""

    final_rpm: float
    slow_s: float
    fast_s: float
    sigmas: tuple[float, float, float]
    rms: float
    samples: int
    order: int

    @property
    def aic(self) -> float:
        """Akaike's criterion; the smaller one is preferred."""
        return 2 * self.samples * math.log(self.rms) + 2 * self.order


def turned(times_s: Column, slow_s: float, fast_s: float) -> Column:
    """Way of a plant of unit final speed after a step at 0, in units of speed times seconds."""
    slow = np.exp(-times_s / slow_s)
    if fast_s < 1e-4 * slow_s:
        return np.asarray(times_s - slow_s * (1 - slow))
    if abs(slow_s - fast_s) < 1e-3 * slow_s:
        return np.asarray(times_s - 2 * slow_s + (2 * slow_s + times_s) * slow)
    fast = np.exp(-times_s / fast_s)
    rest = (slow_s**2 * slow - fast_s**2 * fast) / (slow_s - fast_s)
    return np.asarray(times_s - slow_s - fast_s + rest)


def speed(times_s: Column, slow_s: float, fast_s: float) -> Column:
    """Speed as a part of the final one: the derivative of the angle."""
    slow = np.exp(-times_s / slow_s)
    if fast_s < 1e-4 * slow_s:
        return np.asarray(1 - slow)
    if abs(slow_s - fast_s) < 1e-3 * slow_s:
        return np.asarray(1 - (1 + times_s / slow_s) * slow)
    fast = np.exp(-times_s / fast_s)
    return np.asarray(1 - (slow_s * slow - fast_s * fast) / (slow_s - fast_s))


def fit(records: Sequence[Column], ticks_per_revolution: int) -> PlantFit:
    """``records``: times between ticks in s, each from standstill at the same duty.

    The first time of each is left out: it is how long the wheel stood. Raises ToolError where they
    are too short.
    """
    intervals = [record[1:] for record in records]
    if not intervals or min(map(len, intervals)) < FEWEST_TICKS:
        raise ToolError(
            f"a record has fewer than {FEWEST_TICKS} ticks of a wheel: set record_samples higher"
        )
    final = float(np.median([np.median(one[len(one) // 2 :]) for one in intervals]))
    rate = 1.0 / final
    second, whitener = _fit(intervals, rate, 2)
    first, _ = _fit(intervals, rate, 1, whitener)
    best = min(first, second, key=lambda found: found.aic)
    rpm = 60.0 / ticks_per_revolution
    return PlantFit(
        best.final_rpm * rpm,
        best.slow_s,
        best.fast_s,
        (best.sigmas[0] * rpm, *best.sigmas[1:]),
        best.rms,
        best.samples,
        best.order,
    )


def _fit(
    intervals: Sequence[Column], rate: float, order: int, whitener: Column | None = None
) -> tuple[PlantFit, Column]:
    """``final_rpm`` of the result is in ticks a second. ``whitener``: found here where it is not
    given; two orders can be compared only with the same one.
    """
    lengths = [len(one) for one in intervals]
    measured = np.concatenate(intervals)
    offsets = len(intervals)
    low = [math.log(rate / 2), math.log(SHORTEST_S), *([0.02] * (order - 1)), *[0.0] * offsets]
    high = [math.log(2 * rate), math.log(LONGEST_S), *([1.0] * (order - 1)), *[2.0] * offsets]

    def relative(values: Column) -> Column:
        return np.asarray(measured / _told(values, lengths, order) - 1.0)

    def search(start: Column, whitener: Column | None) -> Any:
        def residuals(values: Column) -> Column:
            found = relative(values) / SIGMA
            return found if whitener is None else _whitened(found, lengths, whitener)

        return least_squares(
            residuals,
            start,
            bounds=(low, high),
            loss="soft_l1",
            x_scale=0.1,
            tr_solver="lsmr",  # without a decomposition, for which BLAS takes threads
            max_nfev=40,
            ftol=1e-7,
            xtol=1e-6,
        )

    starts = [
        np.array([math.log(rate), math.log(total), *([0.3] * (order - 1)), *([0.5] * offsets)])
        for total in STARTS_S
    ]
    best = min((search(start, None) for start in starts), key=_cost)
    if whitener is None:
        whitener = _whitener(_neighbours(relative(best.x), lengths), max(lengths))
    if order == 1:
        best = search(best.x, whitener)
    else:
        again = [np.array([*best.x[:2], ratio, *best.x[3:]]) for ratio in RATIOS]
        best = min((search(start, whitener) for start in again), key=_cost)
    values = best.x
    whitened = _whitened(relative(values), lengths, whitener)
    spread = 1.4826 * float(np.median(np.abs(whitened)))
    kept = np.abs(whitened) < 5 * max(spread, 1e-3)
    rms = float(np.sqrt(np.mean(whitened[kept] ** 2)))
    covariance = np.linalg.pinv(best.jac.T @ best.jac) * (rms / SIGMA) ** 2
    slow_s, fast_s = _constants(values, order)
    own = covariance[: 1 + order, : 1 + order]
    ratio = fast_s / slow_s
    of_slow = np.array([0.0, slow_s, -slow_s / (1 + ratio)])[: 1 + order]
    of_fast = np.array([0.0, fast_s, slow_s / (1 + ratio)])[: 1 + order]
    final = math.exp(values[0])
    found = PlantFit(
        final,
        slow_s,
        fast_s,
        (
            final * math.sqrt(own[0, 0]),
            math.sqrt(of_slow @ own @ of_slow),
            math.sqrt(of_fast @ own @ of_fast) if order == 2 else 0.0,
        ),
        max(rms, 1e-6),
        int(kept.sum()),
        order,
    )
    return found, whitener


def _cost(found: Any) -> float:
    return float(found.cost)


def _constants(values: Column, order: int) -> tuple[float, float]:
    """Slow and fast, from their sum and their ratio, in which there is one optimum."""
    total = math.exp(values[1])
    ratio = float(values[2]) if order == 2 else 0.0
    return total / (1 + ratio), total * ratio / (1 + ratio)


def _neighbours(residuals: Column, lengths: Sequence[int]) -> float:
    """Correlation of each with the next: -0.5 where marks are off their places, 0 where the times
    are measured badly. Robust."""
    spread = 3 * 1.4826 * float(np.median(np.abs(residuals)))
    clipped = np.clip(residuals, -spread, spread)
    ends = np.cumsum(lengths)[:-1]
    parts = np.split(clipped, ends)
    product = sum(float(np.dot(one[1:], one[:-1])) for one in parts)
    return float(np.clip(product / max(float(np.dot(clipped, clipped)), 1e-12), -0.499, 0.0))


def _whitener(correlation: float, length: int) -> Column:
    """Whiten residuals with correlated neighbours: the Cholesky factor, as bands."""
    bands = np.vstack([np.ones(length), np.full(length, correlation)])
    return np.asarray(cholesky_banded(bands, lower=True))


def _whitened(residuals: Column, lengths: Sequence[int], whitener: Column) -> Column:
    """A shorter row takes the beginning of the factor."""
    parts = np.split(residuals, np.cumsum(lengths)[:-1])
    return np.concatenate([solve_banded((1, 0), whitener[:, : len(one)], one) for one in parts])


def _told(values: Column, lengths: Sequence[int], order: int) -> Column:
    """The times between ticks that these parameters tell, record after record."""
    rate, (slow_s, fast_s) = math.exp(values[0]), _constants(values, order)
    ticks = max(lengths) + 3
    last_s = ticks / rate + 2 * (slow_s + fast_s)
    grid_s = last_s * np.linspace(0.0, 1.0, GRID) ** 2  # denser where it starts
    way = rate * turned(grid_s, slow_s, fast_s)
    told = []
    for first, count in zip(values[1 + order :], lengths, strict=True):
        places = first + np.arange(count + 1)
        told.append(np.diff(np.interp(places, way, grid_s)))
    return np.concatenate(told)
