# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Read recorded times between a wheel's ticks, and measure the two levels of its encoder signal.

A record is a CSV file of the driver. This module uses no model of the plant (motor with wheel).
"""

import csv
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from omnibot_driver.tools.calibrate.tick_fit import Column
from omnibot_driver.tools.needs import ToolError

SIDES: Final = ("left", "right")
UNTOLD: Final = 0.2
"""Largest accepted fraction of missing times in a record."""
UNLIKE: Final = 1.5
"""Largest accepted ratio of a time between ticks to the median, or of the median to the time. A
larger ratio shows an edge that the board missed or noticed late."""
SMOOTHED: Final = 4
"""Number of successive times between ticks that are added up to compute one speed, so that a
displaced mark disturbs few speeds."""


def read(path: Path) -> dict[str, Column]:
    """Return the times between ticks in s, for the left and the right wheel; NaN if missing.

    Raises ToolError if the file cannot be read, or if too many times are missing.
    """
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        columns = {
            side: np.array([float(row[f"{side}_tick_s"] or "nan") for row in rows])
            for side in SIDES
        }
    except (OSError, KeyError, ValueError) as error:
        raise ToolError(f"the record {path} cannot be read: {error}") from error
    for times_s in columns.values():
        if not len(times_s) or np.isnan(times_s[1:]).sum() > UNTOLD * len(times_s):
            raise ToolError(
                f"too many times are missing in the record {path}. Either the wheels turned too"
                " slowly for the board to report the times (with a unit of 100 ns, it needs more"
                " than 152 RPM), or the driver does not know the unit of the times"
            )
    return columns


@dataclass(frozen=True, slots=True)
class Levels:
    """Correction factors for the short and long levels of one wheel's encoder signal.

    * ``short``, ``long``: factors for the durations of the levels, which make these durations
      equal.
    * ``sigma``: standard deviation of the factors.
    * ``rpm``: speed during the measurement.
    """

    short: float
    long: float
    sigma: float
    rpm: float


def levels(ticks_s: Column, ticks_per_revolution: int) -> Levels:
    """Return the corrections for an encoder whose two levels differ in duration.

    ``ticks_s``: times between ticks at constant duty, with both corrections set to 1. Raises
    ToolError for irregular ticks.
    """
    usual = float(np.nanmedian(ticks_s))
    good = np.isfinite(ticks_s) & (ticks_s < UNLIKE * usual) & (ticks_s > usual / UNLIKE)
    ways: tuple[list[float], list[float]] = ([], [])
    # After a missed edge, it is unknown which level is the short one.
    for run in _runs(ticks_s, good):
        even, odd = run[::2], run[1::2]
        shorter, longer = (even, odd) if even.mean() <= odd.mean() else (odd, even)
        ways[0].extend(shorter)
        ways[1].extend(longer)
    if min(map(len, ways)) < 20:
        raise ToolError(
            "the ticks of a wheel at constant duty are not regular: run calibrate again"
        )
    short_s, long_s = (float(np.mean(one)) for one in ways)
    mean_s = (short_s + long_s) / 2
    spread = max(np.std(one) / np.sqrt(len(one)) for one in ways) / mean_s
    return Levels(
        mean_s / short_s, mean_s / long_s, float(spread), 60 / (mean_s * ticks_per_revolution)
    )


def _runs(ticks_s: Column, good: "np.ndarray[tuple[int], np.dtype[np.bool_]]") -> Iterable[Column]:
    """Yield each sequence of ten or more regular times between ticks."""
    begin = 0
    for place in range(len(ticks_s) + 1):
        if place == len(ticks_s) or not good[place]:
            if place - begin >= 10:
                yield ticks_s[begin:place]
            begin = place + 1


@dataclass(frozen=True, slots=True)
class Response:
    """A measured step response.

    ``times_s``: times since the first tick, in s.

    ``rpm``: smoothed speeds at these times.
    """

    times_s: Column
    rpm: Column


def response(ticks_s: Column, ticks_per_revolution: int) -> Response:
    """Return the step response in a record of times between ticks.

    The first time is not used, because it includes the standstill.
    """
    times_s = ticks_s[1:].copy()
    times_s[~np.isfinite(times_s)] = np.nanmedian(times_s)
    ends_s = np.concatenate(([0.0], np.cumsum(times_s)))
    passed_s = ends_s[SMOOTHED:] - ends_s[:-SMOOTHED]
    return Response(
        (ends_s[SMOOTHED:] + ends_s[:-SMOOTHED]) / 2,
        60.0 * SMOOTHED / (ticks_per_revolution * passed_s),
    )
