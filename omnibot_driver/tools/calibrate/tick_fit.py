# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Fit a plant to the times between encoder ticks of a wheel that starts at full duty.

Records begin at the first tick, so they do not show the dead time. This module does not know how
records are made.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from omnibot_driver.tools.calibrate.tick_marks import Marks, marks_in
from omnibot_driver.tools.calibrate.tick_search import Search, constants
from omnibot_driver.tools.needs import ToolError

Column = NDArray[np.float64]

FEWEST_TICKS: Final = 30


@dataclass(frozen=True, slots=True)
class Plant:
    """A wheel, as a plant from duty in percent to speed in RPM.

    * ``rpm_per_percent``: final speed per percent of duty above the dead zone.
    * ``slow_s``, ``fast_s``: time constants; ``fast_s`` is 0 for a plant of first order.
    * ``dead_zone_percent``: duty up to which the wheel does not turn.
    """

    rpm_per_percent: float
    slow_s: float
    fast_s: float
    dead_zone_percent: float = 0.0

    def final_rpm(self, duty_percent: float) -> float:
        """Return the final speed, in RPM, at this duty."""
        return self.rpm_per_percent * max(duty_percent - self.dead_zone_percent, 0.0)


@dataclass(frozen=True, slots=True)
class PlantFit:
    """The fit of a plant to records of starts.

    * ``sigmas``: standard deviations of ``final_rpm``, ``slow_s`` and ``fast_s``.
    * ``rms``: root mean square of the relative residuals.
    * ``samples``: number of residuals.
    * ``order``: order of the plant, 1 or 2.
    """

    final_rpm: float
    slow_s: float
    fast_s: float
    sigmas: tuple[float, float, float]
    rms: float
    samples: int
    order: int
    marks: Marks | None = None
    """Distances between the encoder's marks; None if the times between ticks show no errors that
    repeat with each turn."""

    @property
    def aic(self) -> float:
        """Akaike's information criterion. The fit with the smaller value is better."""
        return 2 * self.samples * math.log(self.rms) + 2 * self.order


def speed(times_s: Column, slow_s: float, fast_s: float) -> Column:
    """Return the speed after a step of the duty at time 0, as a fraction of the final speed."""
    slow = np.exp(-times_s / slow_s)
    if fast_s < 1e-4 * slow_s:
        return np.asarray(1 - slow)
    if abs(slow_s - fast_s) < 1e-3 * slow_s:
        return np.asarray(1 - (1 + times_s / slow_s) * slow)
    fast = np.exp(-times_s / fast_s)
    return np.asarray(1 - (slow_s * slow - fast_s * fast) / (slow_s - fast_s))


def fit(records: Sequence[Column], ticks_per_revolution: int) -> PlantFit:
    """Fit a plant to records of starts from standstill, all at the same duty.

    ``records``: times between ticks in s; the first time of each record is not used. Raises
    ToolError if a record is too short.
    """
    # The first time of a record includes the standstill.
    intervals = [record[1:] for record in records]
    if not intervals or min(map(len, intervals)) < FEWEST_TICKS:
        raise ToolError(
            f"a record has fewer than {FEWEST_TICKS} ticks of a wheel: increase --samples"
        )
    search = Search(intervals)
    values = search.roughly()
    if search.find_missed(values):
        values = search.roughly()
    marks = marks_in(search.off(values), ticks_per_revolution)
    if marks is not None:
        values = search.with_marks(marks, values)
    search.correlate(values)  # the fits of first and second order must use the same correlation
    values = search.closely(values)
    second = _described(search, values, marks, ticks_per_revolution)
    first = _described(search, search.first_order(values), marks, ticks_per_revolution)
    return min(first, second, key=lambda found: found.aic)


def _described(search: Search, values: Column, marks: Marks | None, ticks: int) -> PlantFit:
    order, covariance = search.order, search.covariance(values)
    slow_s, fast_s = constants(values, order)
    ratio = fast_s / slow_s
    of_slow = np.array([0.0, slow_s, -slow_s / (1 + ratio)])[: 1 + order]
    of_fast = np.array([0.0, fast_s, slow_s / (1 + ratio)])[: 1 + order]
    final_rpm = 60.0 / ticks * math.exp(values[0])
    left = search.left(values)
    return PlantFit(
        final_rpm,
        slow_s,
        fast_s,
        (
            final_rpm * math.sqrt(covariance[0, 0]),
            math.sqrt(of_slow @ covariance @ of_slow),
            math.sqrt(of_fast @ covariance @ of_fast) if order == 2 else 0.0,
        ),
        max(float(np.sqrt(np.mean(left**2))), 1e-6),
        len(left),
        order,
        marks,
    )
