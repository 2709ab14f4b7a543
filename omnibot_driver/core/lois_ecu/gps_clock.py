# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""UTC from the date and the time of the board's GPS receiver, which arrive in separate reports."""

import calendar
import math
from typing import Final

from omnibot_driver.core.lois_ecu.messages import GpsDate, GpsTime

UNKNOWN_FROM_YEAR: Final = 38
"""Two-digit year (38 for 2038). A date from this year on is false: the GPS receiver does not have
the date yet."""
LONGEST_GAP_S: Final = 12 * 3600
"""Time in s without a reported time of day, after which the date is no longer used: midnight may
have passed unseen."""


class GpsClock:
    """The date and the time that the GPS receiver reported last.

    ``dated``: whether the last reported date is real. ``dated`` stays True after midnight, although
    the date is then that of the day before.
    """

    def __init__(self) -> None:
        self.dated = False
        self._date: GpsDate | None = None
        self._time = GpsTime(0, 0, 0)
        self._came_at_s = -math.inf
        """When the last time of day or date arrived, in s."""

    @property
    def date_known(self) -> bool:
        """Whether today's date is known."""
        return self._date is not None

    def set_date(self, date: GpsDate, now: float) -> None:
        """Use a date that arrived at ``now``.

        The date becomes unknown if it is from 2038 on, or not in the calendar. A receiver that does
        not know the date sends zeros or a false year.
        """
        self.dated = _exists(date) and date.year < UNKNOWN_FROM_YEAR
        self._date = date if self.dated else None
        self._came_at_s = now

    def utc_s(self, time: GpsTime, now: float) -> int | None:
        """Return a time that arrived at ``now`` as UTC, in s since 1970.

        None while the date is unknown.
        """
        if _of_day(time) < _of_day(self._time) or now - self._came_at_s > LONGEST_GAP_S:
            self._date = None  # after midnight there is a new date
        self._time, self._came_at_s = time, now
        if self._date is None:
            return None
        date = self._date
        return calendar.timegm((2000 + date.year, date.month, date.day, *_of_day(time)))


def _exists(date: GpsDate) -> bool:
    if not 1 <= date.month <= 12:
        return False
    return 1 <= date.day <= calendar.monthrange(2000 + date.year, date.month)[1]


def _of_day(time: GpsTime) -> tuple[int, int, int]:
    return time.hours, time.minutes, time.seconds
