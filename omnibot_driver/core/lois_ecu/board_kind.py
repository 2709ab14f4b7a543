# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Detection of the kind of board: with public firmware, or as the manual describes.

* Public firmware: an odometry report follows each tick report, with the same command byte (0x12).
  The board counts ticks only while a wheel is commanded forward.
* Manual: odometry reports have the command byte 0x20. The board counts ticks in both directions.
"""

from typing import Final

from omnibot_driver.core.lois_ecu.board_odometry import Told
from omnibot_driver.core.lois_ecu.motion_filter import MotionFilter
from omnibot_driver.core.lois_ecu.wheel_model import FIRMWARE_STEP_S

LONE_TICKS: Final = 2
"""If at least this number of tick reports came before an odometry report 0x20, the board is of the
manual's kind."""
UNCOUNTED_M: Final = 0.06
"""Distance in m, summed over both wheels. If the wheels roll backward for this distance and no
count decreases, the driver decides that the board does not count ticks backward."""


class BoardKind:
    """The kind of one board. The detected properties are written into the motion filter ``motion``.

    ``appends``: whether the board sends an odometry report directly after each tick report, with
    the command byte of tick reports (0x12).
    """

    def __init__(self, motion: MotionFilter) -> None:
        self._motion = motion
        self.appends = False
        self._seen_signed = self._seen_unsigned = False
        self._lone_ticks, self._uncounted_m = 0, 0.0

    def took_ticks(self, counts: tuple[int, int]) -> None:
        """Record a tick report.

        ``counts``: for each wheel, the change of its tick count since the previous report.
        """
        self._lone_ticks += 1
        if min(counts) < 0:
            self._motion.signed = self._seen_signed = True

    def took_odometry(self, *, appended: bool) -> None:
        """Record an odometry report.

        ``appended``: whether the report was appended to a tick report, with the command byte 0x12
        (public firmware). Otherwise, the command byte is 0x20.
        """
        motion = self._motion
        if appended and not self.appends:
            self.appends, motion.holds = True, True
            motion.signed = self._seen_signed
            motion.speed_errors.begin_excess()
            for wheel in motion.wheels:
                wheel.course.step_s = FIRMWARE_STEP_S
        elif not (appended or self.appends or self._seen_unsigned):
            motion.signed |= self._lone_ticks >= LONE_TICKS

    def watch(self, told: Told | None) -> None:
        """Detect whether this board counts no ticks while a wheel rolls backward.

        ``told``: motion between the last two odometry reports, or None.
        """
        if told is None or not self._motion.signed or self._seen_signed:
            return
        for index, wheel in enumerate(self._motion.wheels):
            back_m = -told.along_m - (index - 0.5) * told.turned_m
            if wheel.course.target_mps < 0 and back_m > 0:
                self._uncounted_m += back_m
        if self._uncounted_m > UNCOUNTED_M:
            self._motion.signed, self._seen_unsigned = False, True
