# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The angle of the front wheel: whether it is known, and whether its sensor works.

Knows angles, the sensor's bits and times; not what is commanded.
"""

import math
from typing import Final

from omnibot_driver.core.fejemis.messages import FrontAngle

OLDEST_S: Final = 0.06
"""An angle of more than four lines ago stops the robot."""
HEALTHY: Final = 0x3C2
LOOKED_AT: Final = 0x7FF
"""Without the counter of frames."""
SICK_LINES: Final = 3
"""In a row: two may be damaged."""
FASTEST_DEGPS: Final = 900.0
LEAP_DEG: Final = 4.0
"""No servo turns the wheel further between two lines."""
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
"""Bit, what it should be, and what it says otherwise (manual, fwl)."""


class FrontWheel:
    """``angle_rad``: the last accepted angle, NaN before the first. ``heard_at``: its time."""

    def __init__(self) -> None:
        self.refused = 0
        """Angles that the wheel cannot have reached."""
        self.begin()

    def begin(self) -> None:
        """Nothing is known of it."""
        self.angle_rad = math.nan
        self.heard_at = -math.inf
        self.fault = ""
        """What is wrong with the sensor, in words; empty while it works."""
        self._sick = 0
        self._doubted_deg: float | None = None

    @property
    def trouble(self) -> str:
        """What is wrong with the sensor, in a sentence; empty while it works."""
        if not self.fault:
            return ""
        return f"the angle sensor of the front wheel reports: {self.fault}; check sensor and magnet"

    @property
    def stale_at(self) -> float:
        """When the angle is too old, unless another comes."""
        return self.heard_at + OLDEST_S + 1e-6

    @property
    def drives_by_rad(self) -> float:
        """What the drive board is to compute with: it allows 90° to either side.

        Beyond, by the manual's equations, its inner wheel would be faster than the outer one.
        """
        return max(-math.pi / 2, min(math.pi / 2, self.angle_rad))

    def known(self, now: float) -> bool:
        """Whether the angle is known, and new enough to drive by."""
        return not self.fault and now - self.heard_at <= OLDEST_S

    def hear(self, told: FrontAngle, now: float) -> bool:
        """Take an angle from the front board. Returns whether it may be relayed."""
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
        """Whether the wheel can have this angle, or the refused angle before it confirms it."""
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
    """What the sensor says of itself; nothing while it works."""
    words = [f"error flags 0x{told.error:x}"] if told.error else []
    if told.diagnosis & LOOKED_AT != HEALTHY:
        words += [
            text for bit, wanted, text in BITS if bool(told.diagnosis >> bit & 1) is not wanted
        ]
    return words
