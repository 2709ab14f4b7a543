# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The GPS receiver and the compass on the board's serial inputs.

This module knows the true pose of the robot. It does not know the host's protocol.
"""

from collections import deque
from dataclasses import dataclass
from math import cos, degrees, radians
from random import Random

METRES_PER_DEGREE = 111_195.0
DAY_S = 86_400


@dataclass(frozen=True, slots=True)
class Fix:
    """A GPS position, date and time.

    date: year of the century, month and day.
    time: hour, minute and second in UTC.
    """

    latitude_deg: float
    longitude_deg: float
    date: tuple[int, int, int]
    time: tuple[int, int, int]


def fix_at(start: tuple[float, float], x_m: float, y_m: float, utc_s: float) -> Fix:
    """Return the fix ``x_m`` east and ``y_m`` north of ``start`` (latitude, longitude in degrees).

    ``utc_s``: time in s since 2000-01-01, in a simplified calendar: 365 days per year, 31 per
    month (December: 24).
    """
    latitude = start[0] + y_m / METRES_PER_DEGREE
    longitude = start[1] + x_m / (METRES_PER_DEGREE * cos(radians(start[0])))
    days, second = divmod(int(utc_s), DAY_S)
    year, day = divmod(days, 365)
    clock = (second // 3600, second // 60 % 60, second % 60)
    return Fix(latitude, longitude, (year % 100, day // 31 + 1, day % 31 + 1), clock)


def sentence(body: str) -> bytes:
    """Return an NMEA sentence with its checksum."""
    total = 0
    for character in body:
        total ^= ord(character)
    return f"${body}*{total:02X}\r\n".encode("ascii")


class Compass:
    """A compass that averages its last three raw readings of 0..359 degrees.

    ``over_north``: whether the mean ignores that 359 and 0 are adjacent. The mean of 359, 1 and 0
    is then 120.
    """

    def __init__(self, noise_deg: float, *, over_north: bool, random: Random) -> None:
        self._raw = deque([0, 0, 0] if over_north else [], maxlen=3)
        self._noise_deg, self._over_north, self._random = noise_deg, over_north, random
        self.last = 0

    def read(self, yaw_rad: float) -> int:
        """Take a reading.

        Return the mean of the last three readings, in degrees clockwise from north, -179..180.
        """
        true = 90.0 - degrees(yaw_rad) + self._random.gauss(0.0, self._noise_deg)
        raw = int(true % 360.0) % 360
        self._raw.append(raw)
        if self._over_north:
            mean = int(sum(self._raw) / 3)
        else:
            away = sum((other - raw + 180) % 360 - 180 for other in self._raw)
            mean = round(raw + away / len(self._raw)) % 360
        self.last = mean - 360 if mean > 180 else mean
        return self.last
