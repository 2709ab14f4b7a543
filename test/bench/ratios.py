# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Comparison of the driver with the *floor*.

The floor is the smallest program with the same output, without any checks. The driver and the floor
are measured alternately.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median, quantiles


@dataclass(frozen=True, slots=True)
class Figure:
    """Results for the driver and for the floor, the smallest program with the same output.

    ``ours``, ``floor``: the values of driver and floor, in pairs. ``goal``: the largest allowed
    ratio of driver to floor.
    """

    name: str
    unit: str
    ours: Sequence[float]
    floor: Sequence[float]
    goal: float | None = None

    @property
    def ratio(self) -> float:
        """Return the median of the ratios of the driver's value to the floor's value.

        The floor is the smallest program with the same output.
        """
        return median(self._ratios)

    @property
    def _ratios(self) -> list[float]:
        return [ours / floor for ours, floor in zip(self.ours, self.floor, strict=True)]

    @property
    def row(self) -> str:
        """Return the row of the Markdown table for this measurement."""
        low, high = min(self._ratios), max(self._ratios)
        if len(self._ratios) > 3:
            low, _, high = quantiles(self._ratios, n=4, method="inclusive")
        goal = "—"
        if self.goal is not None:
            goal = f"≤ {self.goal:.2f}, {'met' if self.ratio <= self.goal else '**missed**'}"
        return (
            f"| {self.name} | {short(median(self.ours))} {self.unit} "
            f"| {short(median(self.floor))} {self.unit} | {self.ratio:.2f} "
            f"| {low:.2f}–{high:.2f} of {len(self._ratios)} | {goal} |"
        )


def table(figures: Sequence[Figure]) -> list[str]:
    """Return the lines of a Markdown table with a row for each measurement."""
    return [
        "| figure | ours | floor | ratio (median) | quartiles | goal |",
        "|---" * 6 + "|",
        *(figure.row for figure in figures),
    ]


def alternate(
    name: str,
    unit: str,
    ours: Callable[[], float],
    floor: Callable[[], float],
    *,
    times: int,
    goal: float | None = None,
) -> Figure:
    """Measure driver (``ours``) and ``floor`` in turn, ``times`` times each; return the results."""
    pairs = [(ours(), floor()) for _ in range(times)]
    return Figure(name, unit, [pair[0] for pair in pairs], [pair[1] for pair in pairs], goal)


def short(value: float) -> str:
    """Return a number as text with three significant digits, or as a whole number from 100 on."""
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"
