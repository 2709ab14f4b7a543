# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""UTC from the date and the time of the board's GPS receiver, which arrive in separate reports."""

import calendar
from typing import Final

from omnibot_driver.core.lois_ecu.messages import GpsDate, GpsTime

UNKNOWN_FROM_YEAR: Final = 38
"""Two-digit year (38 for 2038). A date from this year on is false: the GPS receiver does not have
the date yet."""


class GpsClock:
    """The date and the time that the GPS receiver reported last.

    ``dated``: whether the last reported date is real. ``dated`` stays True after midnight, although
    the date is then that of the day before.
    """

    def __init__(self) -> None:
        self.dated = False
        self._date: GpsDate | None = None
        self._time = GpsTime(0, 0, 0)

    @property
    def date_known(self) -> bool:
        """Whether today's date is known."""
        return self._date is not None

    def set_date(self, date: GpsDate) -> None:
        """Use a reported date; if it is zero or from 2038 on, the date becomes unknown.

        Without a date, the receiver sends zeros or a false year.
        """
        self.dated = bool(date.month and date.day) and date.year < UNKNOWN_FROM_YEAR
        self._date = date if self.dated else None

    def utc_s(self, time: GpsTime) -> int | None:
        """Return a reported time as UTC, in s since 1970; None while the date is unknown."""
        if _of_day(time) < _of_day(self._time):
            self._date = None  # after midnight there is a new date
        self._time = time
        if self._date is None:
            return None
        date = self._date
        return calendar.timegm((2000 + date.year, date.month, date.day, *_of_day(time)))


def _of_day(time: GpsTime) -> tuple[int, int, int]:
    return time.hours, time.minutes, time.seconds
