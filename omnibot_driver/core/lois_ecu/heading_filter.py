# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Filter of compass headings that rejects the false headings of the public firmware near north.

The firmware averages headings as plain numbers: 359, 1 and 1 degrees give 120.
"""

import math
from typing import Final

NEAR_DEG: Final = 20.0
NEAR_PART: Final = 0.2
"""Limit for a heading error: ``NEAR_DEG`` (in degrees) plus ``NEAR_PART`` times the robot's turn.

The turn is measured since the heading with which the new heading is compared.
"""
SURE_AFTER: Final = 4
NORTH_DEG: Final = 45.0
MISTAKEN_DEG: Final = (120.0, -120.0)
MISTAKEN_WITHIN_DEG: Final = 12.0


class HeadingFilter:
    """Filter of compass headings. It counts the rejected headings in ``refused``."""

    def __init__(self) -> None:
        self.refused = 0
        self.forget()

    def forget(self) -> None:
        """Forget all headings.

        The next heading is then rejected. The heading after it is accepted if these two agree.
        """
        self._last: tuple[float, float] | None = None
        self._other: tuple[float, float] | None = None
        self._agreed = 0

    def begin_frame(self, yaw_rad: float) -> None:
        """Continue in a new odometry frame, for example after a reset of the odometry.

        ``yaw_rad``: yaw of the new frame in the old frame.
        """
        if self._last is not None:
            self._last = self._last[0], self._last[1] - yaw_rad
        if self._other is not None:
            self._other = self._other[0], self._other[1] - yaw_rad

    def believes(self, heading_deg: float, yaw_rad: float) -> bool:
        """Return whether a heading is accepted.

        ``heading_deg``: heading clockwise from north.

        ``yaw_rad``: yaw of the odometry when the heading arrived.
        """
        # A heading is accepted if it changed by about as much as the odometry's yaw, or when
        # ``SURE_AFTER`` further headings agree. If a heading near north is expected, headings of
        # about ±120 degrees are rejected even then.
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
        if self._last is None or abs(_expected(self._last, yaw_rad)) > NORTH_DEG:
            return False
        return any(
            abs(_difference(heading_deg, mistaken)) < MISTAKEN_WITHIN_DEG
            for mistaken in MISTAKEN_DEG
        )


def _expected(before: tuple[float, float], yaw_rad: float) -> float:
    """Return the heading that is expected now, from -180 to 180 degrees.

    ``before``: an earlier heading in degrees, and the odometry's yaw at that time in rad.
    """
    return _difference(before[0] - math.degrees(yaw_rad - before[1]), 0.0)


def _goes_on(before: tuple[float, float], heading_deg: float, yaw_rad: float) -> bool:
    turned_deg = abs(math.degrees(yaw_rad - before[1]))
    off_deg = abs(_difference(heading_deg, _expected(before, yaw_rad)))
    return off_deg <= NEAR_DEG + NEAR_PART * turned_deg


def _difference(one_deg: float, other_deg: float) -> float:
    return math.remainder(one_deg - other_deg, 360.0)
