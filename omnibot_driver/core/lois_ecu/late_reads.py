# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Times of reports that waited in the kernel's buffer because the computer read late.

Such reports arrive together. The board's time in each tick report shows when it was sent.
"""

import math
from collections import deque
from statistics import median
from typing import Final

from omnibot_driver.core.lois_ecu.messages import Report, Ticks
from omnibot_driver.core.lois_ecu.plausibility import ClockUnit, began_within, wrapped
from omnibot_driver.core.values import value

LATE_S: Final = 0.4
"""Longest usual time in s without a report.

If several tick reports arrive together after a longer time, the computer has read them late. The
driver corrects their times.
"""
RATES_KEPT: Final = 15
TOWARDS_ARRIVAL: Final = 1.01
"""Factor, a little above 1, by which durations from the board's clock are multiplied. Without it,
an inexact clock rate could make the corrected times fall more and more behind the arrivals.
"""


@value(frozen=True, slots=True)
class Heard:
    """A tick report with its arrival time and its corrected time, both in s."""

    ticks: Ticks
    arrived_s: float
    at_s: float


class LateReads:
    """Times of the reports from one board. They never decrease, and never exceed the arrival times.

    ``ticks_per_revolution`` may be replaced at any time.
    """

    def __init__(self, ticks_per_revolution: int = 60) -> None:
        self.ticks_per_revolution = ticks_per_revolution
        self._last: Heard | None = None
        self._waited = False
        """Whether the last tick report was read late. The next reports may then be late too."""
        self._unit: ClockUnit | None = None
        self._arrived_s = self._latest_s = -math.inf
        self._rates: deque[float] = deque(maxlen=RATES_KEPT)
        """The last measured durations of one unit of the board's clock, in s."""

    def times(
        self, reports: list[Report], arrived: list[float], unit: ClockUnit | None
    ) -> list[float]:
        """Return the times in s of reports that were read together.

        * ``arrived``: for each report, the arrival time of its last line, in s.
        * ``unit``: the unit of the board's clock; None if it is unknown at present.
        """
        self._unit = unit or self._unit
        told = [(at, one) for at, one in enumerate(reports) if isinstance(one, Ticks)]
        known = [self._last.ticks] if self._last else []
        known += [ticks for _, ticks in told]
        # If the board may have restarted, a clock in ns does not show the time that has passed. The
        # arrival times are then used.
        shown = self._unit == "ms" or not any(map(self._may_have_restarted, known, known[1:]))
        found, before = list(arrived), self._last
        leading_s = before.at_s if before and self._waited and not told else math.inf
        for number, (place, ticks) in enumerate(told, 1):
            after = told[number][0] if number < len(told) else len(reports)
            late = after < len(reports) and arrived[place] > self._arrived_s + LATE_S
            at_s = self._time(ticks, arrived[place], late=late, shown=shown)
            if self._waited:
                found[place:after] = [at_s] * (after - place)
                if number == 1 and before:  # the tick report before these reports was lost
                    leading_s = (before.at_s + at_s) / 2
        first = told[0][0] if told else len(reports)
        found[:first] = [min(at_s, leading_s) for at_s in arrived[:first]]
        for place, at_s in enumerate(found):
            self._latest_s = found[place] = max(at_s, self._latest_s)
        self._arrived_s = arrived[-1] if arrived else self._arrived_s
        return found

    def _time(self, ticks: Ticks, arrived_s: float, *, late: bool, shown: bool) -> float:
        """Return the corrected time in s of a tick report.

        * ``late``: whether later tick reports arrived with this one, after a gap above ``LATE_S``.
        * ``shown``: whether the board's clock shows the time since the last tick report.
        """
        last, waited, at_s = self._last, False, arrived_s
        if last is not None:
            since_s = arrived_s - last.arrived_s
            passed = wrapped(ticks.time_counts - last.ticks.time_counts)
            restarted = passed <= 0 or self._may_have_restarted(last.ticks, ticks)
            if restarted:
                passed = ticks.time_counts
            if self._rates:
                passed_s = TOWARDS_ARRIVAL * median(self._rates) * passed
                if restarted and self._unit == "ms":
                    passed_s = passed / 1e3  # the clock runs in real time while the board boots
                waited = shown and (late or (self._waited and since_s < passed_s / 2))
                if waited:
                    at_s = min(arrived_s, last.at_s + passed_s)
            if not (waited or restarted) and since_s > 0.0:
                self._rates.append(since_s / passed)
        self._last, self._waited = Heard(ticks, arrived_s, at_s), waited
        return at_s

    def _may_have_restarted(self, before: Ticks, after: Ticks) -> bool:
        """Return whether the board may have restarted between two tick reports.

        The tick counts decide, because a clock in ns jumps back every 4.3 s without a restart.
        """
        fewer = abs(after.left) + abs(after.right) < abs(before.left) + abs(before.right)
        return fewer and began_within(math.inf, after, self.ticks_per_revolution)
