# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Translation of a LOIS ECU's reports to readings in SI units.

This module also detects a restart of the board. Its input is decoded reports, not lines of text.
"""

import math
from typing import Final

from omnibot_driver.core.lois_ecu.board_time import UNIT_S, BoardTime
from omnibot_driver.core.lois_ecu.gps_clock import GpsClock
from omnibot_driver.core.lois_ecu.heading_filter import HeadingFilter
from omnibot_driver.core.lois_ecu.messages import (
    BoardOdometry,
    EStopButton,
    GpsDate,
    GpsPosition,
    GpsTime,
    Heading,
    LostRecord,
    Record,
    Report,
    TerminalLine,
    Ticks,
)
from omnibot_driver.core.lois_ecu.odometry import FusedOdometry, LoisOdometry
from omnibot_driver.core.lois_ecu.plausibility import (
    FASTEST_TURNS_PER_S,
    TICKS_MARGIN,
    TURNS_MARGIN,
    ClockUnit,
    began_within,
    wrapped,
)
from omnibot_driver.core.lois_ecu.readings import (
    FixReading,
    HeadingReading,
    LoisReading,
    TimeReading,
)
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.core.readings import DisplacementReading

MIDNIGHT: Final = GpsTime(0, 0, 0)
TICKS_LINES, ODOMETRY_LINES, POSITION_LINES = 4, 7, 3
RESTARTED_TURNS: Final = 0.3
RESTARTED_TICKS: Final = 2
RESTARTED_TURNS_PER_S: Final = 1.0
"""The largest plausible decrease of a wheel's count from one tick report to the next.

In ``duration`` seconds, a wheel can roll back by ``RESTARTED_TURNS + RESTARTED_TURNS_PER_S *
duration`` turns, plus ``RESTARTED_TICKS`` ticks. If a count decreases by more than this, the board
has restarted.
"""
SILENT_S: Final = 1.0
"""Limit, in s, for the time without tick reports, used to detect a restart of the board.

If the counts are near zero and the clock is irregular, either the board has restarted, or the
wheels have rolled back. If the time without tick reports is above the limit, the driver assumes a
restart.
"""
NS_WRAPS_S: Final = 2**32 * UNIT_S["ns"]
"""Time in s after which a clock in ns starts from zero again."""
CONTRADICTED_S: Final = 1.0
"""Limit, in s, for the time since the last tick report, if the board's clock does not confirm it.

To detect a restart, the driver computes how far the wheels may have rolled back since the last tick
report. If the unit of the board's clock has just become unknown, the driver computes with at most
this limit.
"""
IN_FLIGHT_S: Final = 0.5
"""Time in s, from the first counts after a reset, in which counts may still be from before the
reset.

There are two causes for such counts. The board may have sent them before it received the reset.
Or the driver may have read them late.
"""


class Translation:
    """Translation of reports. ``settings`` may be replaced at any time.

    ``restarts``: number of restarts of the board that the driver has noticed.
    """

    def __init__(self, settings: LoisEcuSettings) -> None:
        self._settings = settings
        self.odometry = LoisOdometry(settings)
        self.headings = HeadingFilter()
        self.restarts = 0
        self.last_ticks_at_s = -math.inf
        self.ticked_at_s = -math.inf
        """Time in s of the last report in which at least one tick count had changed."""
        self._reset_until_s: float | None = None
        """Time in s until which received counts may be from before a reset; None if no reset was
        sent."""
        self._connect()

    @property
    def settings(self) -> LoisEcuSettings:
        """Settings of the board and the robot, which the board does not report."""
        return self._settings

    @settings.setter
    def settings(self, settings: LoisEcuSettings) -> None:
        self._settings = settings
        self.odometry.configure(settings)

    def _connect(self) -> None:
        self._ticks: Ticks | None = None
        self._unit: ClockUnit | None = None
        self._unit_known = False
        self._time, self._late_s = BoardTime(), 0.0
        self._stamp_s: float | None = None
        self._gps_clock = GpsClock()
        self._gps_works = False

    def connect(self) -> None:
        """Begin a new connection."""
        self._begin_counts()
        self._reset_until_s = None

    def reset(self) -> None:
        """Forget the earlier counts, because the driver sends a reset to the board.

        Counts from before the reset may still arrive after this call.
        """
        self._begin_counts()
        self._reset_until_s = math.inf

    def _begin_counts(self) -> None:
        self._connect()
        self.odometry.connect()
        self.headings.forget()

    def readings(
        self,
        reports: list[Report],
        times: list[float],
        clock_unit: ClockUnit | None,
        now: float,
    ) -> list[LoisReading]:
        """Return the readings of the reports, in order.

        ``times``: when each report arrived, corrected for late reads. ``now``: time of the read.
        """
        self._gps_works = False
        found: list[LoisReading] = []
        for at, report in zip(times, reports, strict=True):
            found += self._readings(report, clock_unit, at, now)
        return found

    def _readings(
        self, report: Report, clock_unit: ClockUnit | None, now: float, read_s: float
    ) -> list[LoisReading]:
        odometry = self.odometry
        match report:
            case Ticks():
                if self._was_reset(report, read_s):
                    self._begin_counts()
                restarted = self._watch(report, clock_unit, now)
                self._late_s = self._time.late_s(report.time_counts, self._unit, now)
                odometry.estimates.late_stddev_s = self._time.stddev_s
                self._time.sent(TICKS_LINES)
                return restarted + self._displaced(odometry.heard_ticks(report, now, self._late_s))
            case BoardOdometry(appended=appended):
                self._time.sent(ODOMETRY_LINES)
                late_s = self._late_s if appended else 0.0
                odometry.heard_odometry(report, now, late_s)
            case GpsPosition(latitude, longitude):
                self._time.sent(POSITION_LINES)
                located = bool(latitude or longitude)
                self._gps_works |= located
                return [FixReading(latitude, longitude, located and self._gps_clock.dated)]
            case GpsDate():
                self._time.sent(1)
                self._gps_clock.set_date(report)
            case GpsTime():
                self._time.sent(1)
                self._gps_works |= report != MIDNIGHT
                return [TimeReading(self._gps_clock.utc_s(report))]
            case Heading(heading_deg):
                self._time.sent(1)
                return self._heading(heading_deg)
            case EStopButton():
                self.odometry.halted(now)
                return [report]
            case Record(lines=lines):
                self._time.sent(lines)
                return [report]
            case LostRecord(lines):
                self._time.sent(lines)
            case TerminalLine():
                return [report]
        return []

    def _was_reset(self, ticks: Ticks, read_s: float) -> bool:
        """Return whether the board may have obeyed a reset since the last report of ticks.

        This is so if a reset was sent, and a count is nearer to zero than in the last report.

        ``read_s``: time of the read in s, without a correction for a late read.
        """
        before, until_s = self._ticks, self._reset_until_s
        if until_s is None:
            return False
        if before is None:
            self._reset_until_s = read_s + IN_FLIGHT_S
            return False
        if read_s >= until_s:
            self._reset_until_s = None  # the next ticks are certainly from after the reset
        return abs(ticks.left) < abs(before.left) or abs(ticks.right) < abs(before.right)

    def _watch(self, ticks: Ticks, clock_unit: ClockUnit | None, now: float) -> list[LoisReading]:
        before, self._ticks = self._ticks, ticks
        duration_s, self.last_ticks_at_s = now - self.last_ticks_at_s, now
        if before is None:
            self.ticked_at_s = now
            return []
        ways = wrapped(ticks.left - before.left), wrapped(ticks.right - before.right)
        if any(ways):
            self.ticked_at_s = now
        self._unit = clock_unit or self._unit
        contradicted = self._unit_known and clock_unit is None
        self._unit_known = clock_unit is not None
        age_s = self._age_s(ticks, duration_s)
        late = self._unit == "ms" and wrapped(ticks.time_counts - before.time_counts) < 0
        if contradicted:
            duration_s = min(duration_s, CONTRADICTED_S)
        per_turn = self._settings.ticks_per_revolution
        rolled = RESTARTED_TURNS_PER_S * per_turn * duration_s
        left, right = abs(before.left) - abs(ticks.left), abs(before.right) - abs(ticks.right)
        fewer = max(left - rolled, right - rolled, left + right - 2 * rolled)
        # Counts that were zero before do not decrease. Then only the clock shows the restart.
        no_counts = not any((*ways, ticks.left, ticks.right))
        clock_alone = contradicted and self._unit == "ns" and no_counts
        decreased = left + right > 0 or clock_alone
        began = decreased and began_within(duration_s, ticks, per_turn)
        if began and not contradicted:
            began = self._unit == "ns" and self._restart_is_shown(ticks, duration_s, now)
        shrunk = fewer > RESTARTED_TURNS * per_turn + RESTARTED_TICKS
        if shrunk and not contradicted:
            shrunk = self._may_be_new(ticks, max(left, right), duration_s, now)
        if late or began or shrunk:
            self.restarts += 1
            self.odometry.restarted(now, age_s)
            self._time.begin()
            self.headings.forget()
            return [DisplacementReading(0.0, 0.0, 0.0, "body", None, 0, restarted=True)]
        return []

    def _may_be_new(self, ticks: Ticks, fallen: int, duration_s: float, now: float) -> bool:
        """Return whether counts that have decreased fast can be those of a restarted board.

        The result is False in two cases:

        * The counts are larger than a wheel can roll in ``duration_s``.
        * The expected motion explains the counts: in duty mode, wheels may roll back faster than
          ``RESTARTED_TURNS_PER_S``. This is checked only while the reports show a clock in ns and
          counts of both wheels.

        ``fallen``: the larger decrease of a count.
        """
        turns = FASTEST_TURNS_PER_S * duration_s + TURNS_MARGIN
        most = turns * self._settings.ticks_per_revolution + TICKS_MARGIN
        if max(abs(ticks.left), abs(ticks.right)) > most:
            return False
        known = self._unit == "ns" and self._unit_known and duration_s <= SILENT_S
        if fallen > most or not (known and self.odometry.counting):
            return True
        return self.odometry.only_a_restart_explains(ticks, now, 0.0)

    def _age_s(self, ticks: Ticks, duration_s: float) -> float | None:
        """Return the time in s since the board's start; None if it is unknown.

        The caller assumes that the board has started after the previous report. The clock begins at
        zero at the start, so its value is the result.

        The result is None if the unit of the clock is unknown. A clock in ns also begins at zero
        every 4.3 s, so its value is used only if the previous report is less than 4.3 s old, and
        the value is not larger than the age of this report.

        ``ticks``: the new report. ``duration_s``: time in s since the previous report.
        """
        if self._unit is None:
            return None
        age_s = ticks.time_counts * UNIT_S[self._unit]
        # A clock in ns wraps every 4.3 s. So after a longer pause, the age is unknown.
        wrapped_too = self._unit == "ns" and not age_s <= duration_s < NS_WRAPS_S
        return None if wrapped_too else age_s

    def _restart_is_shown(self, ticks: Ticks, duration_s: float, now: float) -> bool:
        """Return whether the clock and the counts prove a restart of the board.

        This method is called if the counts and the clock may have begun at zero again. A small
        clock value alone proves nothing, because a clock in ns begins at zero every 4.3 s.

        A restart is proved if the clock does not fit the earlier reports, and rolling wheels do not
        explain the counts. If no ticks came for more than ``SILENT_S``, the clock alone proves it.
        Without a proof, the uncertainty of the odometry is increased, because a restart is still
        possible.
        """
        odometry, silent = self.odometry, duration_s > SILENT_S
        deviation_s, certain = self._time.deviation_s(ticks.time_counts, self._unit, now)
        late_s = max(deviation_s, 0.0)
        if certain and (silent or odometry.only_a_restart_explains(ticks, now, late_s)):
            return True
        odometry.may_have_restarted(ticks, now, late_s)
        return False

    @property
    def needs_date(self) -> bool:
        """Whether the GPS works, that is, sends a position or a time, but the date is unknown."""
        return self._gps_works and not self._gps_clock.date_known

    @property
    def ticks(self) -> Ticks | None:
        """The last received tick counts. None until the first tick report of a connection."""
        return self._ticks

    def _displaced(self, estimates: list[FusedOdometry]) -> list[LoisReading]:
        return [reading for fused in estimates for reading in self._of(fused)]

    def _of(self, fused: FusedOdometry) -> list[LoisReading]:
        before, self._stamp_s = self._stamp_s, fused.stamp_s
        way = fused.displacement
        return [
            DisplacementReading(
                way.x_m,
                way.y_m,
                way.yaw_rad,
                "body",
                None if before is None else fused.stamp_s - before,
                0,
                measured=self.odometry.counting and fused.source in ("ticks", "standing"),
            ),
            fused,
        ]

    def _heading(self, heading_deg: int) -> list[LoisReading]:
        now = self.odometry.yaw_rad
        if not self.headings.believes(float(heading_deg), now):
            return []
        magnetic_rad = math.radians(heading_deg)
        yaw_rad = math.pi / 2 - (magnetic_rad + self.settings.declination_rad)
        return [HeadingReading(math.remainder(yaw_rad, math.tau))]
