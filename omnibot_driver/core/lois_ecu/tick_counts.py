# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The tick counts of a LOIS ECU: the last ones, and whether new ones show a restart of the board.

Counts and a clock near zero do not prove a restart: wheels roll back, and a clock in ns wraps every
4.3 s. This module does not know other reports.
"""

import math
from typing import Final

from omnibot_driver.core.lois_ecu.board_time import UNIT_S, BoardTime
from omnibot_driver.core.lois_ecu.messages import Ticks
from omnibot_driver.core.lois_ecu.odometry import LoisOdometry
from omnibot_driver.core.lois_ecu.plausibility import (
    FASTEST_TURNS_PER_S,
    TICKS_MARGIN,
    TURNS_MARGIN,
    ClockUnit,
    began_within,
    wrapped,
)

RESTARTED_TURNS: Final = 0.3
RESTARTED_TICKS: Final = 2
RESTARTED_TURNS_PER_S: Final = 1.0
"""Part of the largest plausible decrease of a wheel's count without a restart of the board.

In ``duration`` s, this decrease is ``RESTARTED_TURNS + RESTARTED_TURNS_PER_S * duration`` turns,
plus ``RESTARTED_TICKS`` ticks.
"""
SILENT_S: Final = 1.0
"""Shortest silence in s after which low counts and a deviating clock prove a restart of the board.

After a shorter silence, a third proof is needed: the expected motion cannot explain the counts.
"""
NS_WRAPS_S: Final = 2**32 * UNIT_S["ns"]
"""Time in s after which a clock in ns starts from zero again."""
CONTRADICTED_S: Final = 1.0
"""Longest time in s for which wheels are assumed to roll back between two tick reports. The limit
holds if the second report contradicts the known unit of the board's clock."""
IN_FLIGHT_S: Final = 0.5
"""Time in s for which received counts may be older than a reset.

The time begins with the first counts that arrive after the driver has sent the reset.
"""


class TickCounts:
    """The tick counts of one board, over all connections.

    * ``last``: the last counts; None before the first ones of a connection or after a reset.
    * ``came_at_s``: time of the last counts, in s.
    * ``changed_at_s``: time of the last counts that had changed, in s.
    * ``unit``: unit of the board's clock; None if it is not known yet.
    * ``time``: the board's clock against the time of arrival.
    * ``restarts``: number of restarts of the board that the driver has noticed.
    """

    def __init__(self, odometry: LoisOdometry, ticks_per_revolution: int) -> None:
        self._odometry = odometry
        self.ticks_per_revolution = ticks_per_revolution
        self.restarts = 0
        self.came_at_s = self.changed_at_s = -math.inf
        self._reset_until_s: float | None = None
        """Time in s until which received counts may be from before a reset; None if no reset was
        sent."""
        self.begin()

    def begin(self) -> None:
        """Forget the earlier counts, and what is known of the board's clock."""
        self.last: Ticks | None = None
        self.unit: ClockUnit | None = None
        self._unit_known = False
        self.time = BoardTime()

    def connect(self) -> None:
        """Begin a new connection."""
        self.begin()
        self._reset_until_s = None

    def reset(self) -> None:
        """Forget the earlier counts, because the driver sends a reset to the board.

        Counts from before the reset may still arrive after this call.
        """
        self.begin()
        self._reset_until_s = math.inf

    def was_reset(self, ticks: Ticks, read_s: float) -> bool:
        """Return whether the board may have obeyed a reset since the last report of ticks.

        ``read_s``: time of the read in s, without a correction for a late read.
        """
        before, until_s = self.last, self._reset_until_s
        if until_s is None:
            return False
        if before is None:
            self._reset_until_s = read_s + IN_FLIGHT_S
            return False
        if read_s >= until_s:
            self._reset_until_s = None  # the next ticks are certainly from after the reset
        return abs(ticks.left) < abs(before.left) or abs(ticks.right) < abs(before.right)

    def restarted(self, ticks: Ticks, clock_unit: ClockUnit | None, now: float) -> bool:
        """Return whether new counts show a restart of the board, and keep them as the last ones.

        ``clock_unit``: unit of the board's clock; None if it is unknown. ``now``: when the counts
        arrived, in s.
        """
        before, self.last = self.last, ticks
        duration_s, self.came_at_s = now - self.came_at_s, now
        if before is None:
            self.changed_at_s = now
            return False
        ways = wrapped(ticks.left - before.left), wrapped(ticks.right - before.right)
        if any(ways):
            self.changed_at_s = now
        self.unit = clock_unit or self.unit
        contradicted = self._unit_known and clock_unit is None
        self._unit_known = clock_unit is not None
        age_s = self._age_s(ticks, duration_s)
        late = self.unit == "ms" and wrapped(ticks.time_counts - before.time_counts) < 0
        if contradicted:
            duration_s = min(duration_s, CONTRADICTED_S)
        per_turn = self.ticks_per_revolution
        rolled = RESTARTED_TURNS_PER_S * per_turn * duration_s
        left, right = abs(before.left) - abs(ticks.left), abs(before.right) - abs(ticks.right)
        fewer = max(left - rolled, right - rolled, left + right - 2 * rolled)
        # Counts that were zero before do not decrease. Then only the clock shows the restart.
        no_counts = not any((*ways, ticks.left, ticks.right))
        clock_alone = contradicted and self.unit == "ns" and no_counts
        decreased = left + right > 0 or clock_alone
        began = decreased and began_within(duration_s, ticks, per_turn)
        if began and not contradicted:
            began = self.unit == "ns" and self._restart_is_shown(ticks, duration_s, now)
        shrunk = fewer > RESTARTED_TURNS * per_turn + RESTARTED_TICKS
        if shrunk and not contradicted:
            shrunk = self._may_be_new(ticks, max(left, right), duration_s, now)
        if not (late or began or shrunk):
            return False
        self.restarts += 1
        self._odometry.restarted(now, age_s)
        self.time.begin()
        return True

    def _may_be_new(self, ticks: Ticks, fallen: int, duration_s: float, now: float) -> bool:
        """Return whether the new counts after a large decrease can be those of a restarted board.

        ``fallen``: decrease, in ticks, of the count that has decreased more. ``duration_s``: time
        in s since the previous report.
        """
        turns = FASTEST_TURNS_PER_S * duration_s + TURNS_MARGIN
        most = turns * self.ticks_per_revolution + TICKS_MARGIN
        # No wheel can have rolled this distance since a restart.
        if max(abs(ticks.left), abs(ticks.right)) > most:
            return False
        known = self.unit == "ns" and self._unit_known and duration_s <= SILENT_S
        if fallen > most or not (known and self._odometry.counting):
            return True
        # The wheels may have rolled back to the new counts.
        return self._odometry.only_a_restart_explains(ticks, now, 0.0)

    def _age_s(self, ticks: Ticks, duration_s: float) -> float | None:
        """Return the time in s since the board's start, by the board's clock, or None if unknown.

        The caller assumes that the board has started since the previous report, which came
        ``duration_s`` ago.
        """
        if self.unit is None:
            return None
        age_s = ticks.time_counts * UNIT_S[self.unit]
        # A clock in ns wraps every 4.3 s. So after a longer pause, the age is unknown.
        wrapped_too = self.unit == "ns" and not age_s <= duration_s < NS_WRAPS_S
        return None if wrapped_too else age_s

    def _restart_is_shown(self, ticks: Ticks, duration_s: float, now: float) -> bool:
        """Return whether the clock and the counts prove a restart of the board.

        Without a proof, this method increases the uncertainty of the odometry.
        """
        odometry, silent = self._odometry, duration_s > SILENT_S
        deviation_s, certain = self.time.deviation_s(ticks.time_counts, self.unit, now)
        late_s = max(deviation_s, 0.0)
        if certain and (silent or odometry.only_a_restart_explains(ticks, now, late_s)):
            return True
        odometry.may_have_restarted(ticks, now, late_s)
        return False
