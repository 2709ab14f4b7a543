# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Translation of a LOIS ECU's reports to readings in SI units.

Its input is decoded reports, not lines of text.
"""

import math
from typing import Final

from omnibot_driver.core.lois_ecu.fused_odometry import FusedOdometry
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
from omnibot_driver.core.lois_ecu.odometry import LoisOdometry
from omnibot_driver.core.lois_ecu.plausibility import (
    ClockUnit,
)
from omnibot_driver.core.lois_ecu.readings import (
    FixReading,
    HeadingReading,
    LoisReading,
    TimeReading,
)
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.core.lois_ecu.tick_counts import TickCounts
from omnibot_driver.core.readings import DisplacementReading

MIDNIGHT: Final = GpsTime(0, 0, 0)
RESTARTED: Final = DisplacementReading(0.0, 0.0, 0.0, "body", None, 0, restarted=True)
TICKS_LINES, ODOMETRY_LINES, POSITION_LINES = 4, 7, 3


class Translation:
    """Translation of reports. ``settings`` may be replaced at any time.

    ``counts``: the tick counts, and the restarts that they have shown.
    """

    def __init__(self, settings: LoisEcuSettings) -> None:
        self._settings = settings
        self.odometry = LoisOdometry(settings)
        self.headings = HeadingFilter()
        self.counts = TickCounts(self.odometry, settings.ticks_per_revolution)
        self._forget()

    @property
    def settings(self) -> LoisEcuSettings:
        """Settings of the board and the robot, which the board does not report."""
        return self._settings

    @settings.setter
    def settings(self, settings: LoisEcuSettings) -> None:
        self._settings = settings
        self.odometry.configure(settings)
        self.counts.ticks_per_revolution = settings.ticks_per_revolution

    def _forget(self) -> None:
        self._late_s = 0.0
        self._stamp_s: float | None = None
        self._gps_clock = GpsClock()
        self._gps_works = False

    def connect(self) -> None:
        """Begin a new connection."""
        self.counts.connect()
        self._begin()

    def reset(self) -> None:
        """Forget the earlier counts, because the driver sends a reset to the board.

        Counts from before the reset may still arrive after this call.
        """
        self.counts.reset()
        self._begin()

    def _begin(self) -> None:
        self._forget()
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
        odometry, counts = self.odometry, self.counts
        match report:
            case Ticks():
                if counts.was_reset(report, read_s):
                    counts.begin()
                    self._begin()
                found: list[LoisReading] = []
                if counts.restarted(report, clock_unit, now):
                    self.headings.forget()
                    found.append(RESTARTED)
                self._late_s = counts.time.late_s(report.time_counts, counts.unit, now)
                odometry.estimates.late_stddev_s = counts.time.stddev_s
                counts.time.sent(TICKS_LINES)
                return found + self._displaced(odometry.heard_ticks(report, now, self._late_s))
            case BoardOdometry(appended=appended):
                counts.time.sent(ODOMETRY_LINES)
                late_s = self._late_s if appended else 0.0
                odometry.heard_odometry(report, now, late_s)
            case GpsPosition(latitude, longitude):
                counts.time.sent(POSITION_LINES)
                located = bool(latitude or longitude)
                self._gps_works |= located
                return [FixReading(latitude, longitude, located and self._gps_clock.dated)]
            case GpsDate():
                counts.time.sent(1)
                self._gps_clock.set_date(report, now)
            case GpsTime():
                counts.time.sent(1)
                self._gps_works |= report != MIDNIGHT
                return [TimeReading(self._gps_clock.utc_s(report, now))]
            case Heading(heading_deg):
                counts.time.sent(1)
                return self._heading(heading_deg)
            case EStopButton():
                self.odometry.halted(now)
                return [report]
            case Record(lines=lines):
                counts.time.sent(lines)
                return [report]
            case LostRecord(lines):
                counts.time.sent(lines)
            case TerminalLine():
                return [report]
        return []

    @property
    def needs_date(self) -> bool:
        """Whether the GPS works, that is, sends a position or a time, but the date is unknown."""
        return self._gps_works and not self._gps_clock.date_known

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
