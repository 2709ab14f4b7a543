# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Checks each reported angle of the front wheel, and whether the angle sensor works.

The module does not know the commanded angle.
"""

import math
from typing import Final

from omnibot_driver.core.fejemis.messages import FrontAngle

OLDEST_S: Final = 0.06
"""Age of the last angle, in s, above which the robot is stopped. An angle comes every 15 ms."""
HEALTHY: Final = 0x3C2
LOOKED_AT: Final = 0x7FF
"""Mask of the diagnosis bits that are checked: all bits except the frame counter."""
SICK_LINES: Final = 3
"""How many lines in a row must report a fault before the angle sensor is regarded as faulty."""
FASTEST_DEGPS: Final = 900.0
LEAP_DEG: Final = 4.0
"""Tolerance, in degrees, for the change from the last accepted angle to a new one. The change at
the wheel's highest speed (``FASTEST_DEGPS``) is allowed in addition.
"""
BITS: Final = (
    (10, False, "broken Hall element"),
    (9, True, "gain control not settled"),
    (8, True, "offset compensation not finished"),
    (7, True, "sine offset compensation not finished"),
    (6, True, "cosine offset compensation not finished"),
    (5, False, "magnitude below half of its target"),
    (4, False, "gain control high"),
    (3, False, "gain control low"),
    (2, False, "CORDIC overflow"),
    (1, True, "magneto core loops not finished"),
    (0, False, "supply in 5 V mode"),
)
"""The diagnosis bits of the angle sensor (manual, fwl): number of the bit, its value without a
fault, name of the fault.
"""


class FrontWheel:
    """State of the front wheel.

    * ``angle_rad``: the last accepted angle in rad; NaN before the first.
    * ``heard_at``: arrival time of the last accepted angle in s.
    """

    def __init__(self) -> None:
        self.refused = 0
        """How many angles were rejected because the wheel cannot have reached them."""
        self.begin()

    def begin(self) -> None:
        """Forget the wheel's angle and the faults of its sensor."""
        self.angle_rad = math.nan
        self.heard_at = -math.inf
        self.fault = ""
        """The faults of the angle sensor, as text; empty while the sensor works."""
        self._sick = 0
        self._doubted_deg: float | None = None

    @property
    def trouble(self) -> str:
        """Faults of the angle sensor as a sentence with advice; empty while the sensor works."""
        if not self.fault:
            return ""
        return (
            f"the angle sensor of the front wheel reports: {self.fault}; check the sensor and its"
            " magnet"
        )

    @property
    def stale_at(self) -> float:
        """Time in s from which the last accepted angle is too old for driving."""
        return self.heard_at + OLDEST_S + 1e-6

    @property
    def drives_by_rad(self) -> float:
        """Angle in rad that is relayed to the drive board, limited to ±90°.

        At a larger angle, the board would drive its inner wheel faster than the outer one.
        """
        return max(-math.pi / 2, min(math.pi / 2, self.angle_rad))

    def known(self, now: float) -> bool:
        """Return whether the angle sensor works and its last angle is recent enough for driving."""
        return not self.fault and now - self.heard_at <= OLDEST_S

    def hear(self, told: FrontAngle, now: float) -> bool:
        """Receive an angle from the front board; return whether the angle is accepted."""
        words = complaints(told)
        self._sick = self._sick + 1 if words else 0
        if words:
            if self._sick >= SICK_LINES:
                self.fault = ", ".join(words)
            return False
        if not self._reachable(told.angle_deg, now):
            self.refused += 1
            return False
        self.fault = ""
        self.angle_rad, self.heard_at = math.radians(told.angle_deg), now
        return True

    def _reachable(self, angle_deg: float, now: float) -> bool:
        """Return whether the wheel can have reached the angle.

        The first angle is always reachable. Each later angle must be near the last accepted angle,
        or near a rejected angle that came directly before.
        """
        doubted, self._doubted_deg = self._doubted_deg, None
        within_deg = LEAP_DEG + FASTEST_DEGPS * max(0.0, now - self.heard_at)
        if math.isnan(self.angle_rad) or (
            abs(angle_deg - math.degrees(self.angle_rad)) <= within_deg
        ):
            return True
        if doubted is not None and abs(angle_deg - doubted) <= 4 * LEAP_DEG:
            return True
        self._doubted_deg = angle_deg
        return False


def complaints(told: FrontAngle) -> list[str]:
    """Return the faults that the angle sensor reports; empty while the sensor works."""
    words = [f"error flags 0x{told.error:x}"] if told.error else []
    if told.diagnosis & LOOKED_AT != HEALTHY:
        words += [
            text for bit, wanted, text in BITS if bool(told.diagnosis >> bit & 1) is not wanted
        ]
    return words
