# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Compass headings without the false ones that the public firmware makes at north.

It averages three numbers of 0 to 359: between 359 and 1 it says 120 or -121. A heading is believed
that goes on from the last one by what the odometry turned meanwhile. Another one is believed when a
second of headings agrees with it, and it is none of the two that north is mistaken for. Knows
degrees and the odometry's yaw, no lines.
"""

import math
from typing import Final

NEAR_DEG: Final = 20.0
NEAR_PART: Final = 0.2
"""Of what the odometry turned."""
SURE_AFTER: Final = 4
NORTH_DEG: Final = 45.0
MISTAKEN_DEG: Final = (120.0, -120.0)
MISTAKEN_WITHIN_DEG: Final = 12.0


class HeadingFilter:
    """``refused``: how many headings could not be true."""

    def __init__(self) -> None:
        self.refused = 0
        self.forget()

    def forget(self) -> None:
        """The next one is the first, and must be confirmed."""
        self._last: tuple[float, float] | None = None
        self._other: tuple[float, float] | None = None
        self._agreed = 0

    def believes(self, heading_deg: float, yaw_rad: float) -> bool:
        """``heading_deg`` clockwise from north; ``yaw_rad`` of the odometry at the same time."""
        if self._last is not None and _goes_on(self._last, heading_deg, yaw_rad):
            self._last, self._other, self._agreed = (heading_deg, yaw_rad), None, 0
            return True
        if self._other is not None and _goes_on(self._other, heading_deg, yaw_rad):
            self._agreed += 1
        else:
            self._agreed = 0
        self._other = heading_deg, yaw_rad
        if self._last is None:
            sure = self._agreed >= 1
        else:
            sure = self._agreed >= SURE_AFTER and not self._mistaken(heading_deg, yaw_rad)
        if not sure:
            self.refused += 1
            return False
        self._last, self._other, self._agreed = (heading_deg, yaw_rad), None, 0
        return True

    def _mistaken(self, heading_deg: float, yaw_rad: float) -> bool:
        """Whether the robot looks north, and the firmware makes this of it."""
        if self._last is None or abs(_expected(self._last, yaw_rad)) > NORTH_DEG:
            return False
        return any(
            abs(_difference(heading_deg, mistaken)) < MISTAKEN_WITHIN_DEG
            for mistaken in MISTAKEN_DEG
        )


def _expected(before: tuple[float, float], yaw_rad: float) -> float:
    """The heading that the odometry expects, -180..180."""
    return _difference(before[0] - math.degrees(yaw_rad - before[1]), 0.0)


def _goes_on(before: tuple[float, float], heading_deg: float, yaw_rad: float) -> bool:
    turned_deg = abs(math.degrees(yaw_rad - before[1]))
    off_deg = abs(_difference(heading_deg, _expected(before, yaw_rad)))
    return off_deg <= NEAR_DEG + NEAR_PART * turned_deg


def _difference(one_deg: float, other_deg: float) -> float:
    return math.remainder(one_deg - other_deg, 360.0)
