# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Detection of a stalled wheel: commanded to turn, but at rest, and possibly unable to start.

Forward motion is seen in the ticks, backward motion in the board's odometry (0x20).

This module works on set-points, reports and times.
"""

import math
from typing import Final

from omnibot_driver.core.lois_ecu.board_odometry import rim_speeds
from omnibot_driver.core.lois_ecu.messages import BoardOdometry, SetDuty, SetRpm, Setting, Ticks
from omnibot_driver.core.lois_ecu.resting import FASTEST_RPM
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings

# The public firmware's controller keeps using the last measured speed of a wheel at rest. If this
# speed is higher than a new set-point, the motor gets no power. RPM 0/0 clears the speed.
STALLED_S: Final = 2.0
"""Time in s without motion after which a commanded wheel is regarded as stalled. With the
firmware's gains, a wheel starts in half of this time."""
LEAST_RPM: Final = 2
LEAST_TICKS: Final = 2
"""Least number of ticks in ``STALLED_S`` that a set-point must command. A wheel with a lower
set-point is never regarded as stalled, because it may show no motion although it rolls."""
SAME_MPS: Final = 1e-3
TOO_FAST: Final = 1.2
TOO_FAST_RPM: Final = 3
"""A repeated speed is outdated, and the wheel is at rest, if the speed is more than ``TOO_FAST``
times the set-point, and more than ``TOO_FAST_RPM`` RPM above it."""
UNLIKE: Final = 1.15
"""Largest plausible ratio of the *relative speeds* (speed divided by set-point) of two wheels that
roll backward. A larger ratio can show that a reported speed is outdated."""
FEED_FORWARD: Final = (Setting.LEFT_FEED_FORWARD, Setting.RIGHT_FEED_FORWARD)
AT_LEAST: Final = 4
AT_LEAST_BACKWARD: Final = 8
"""Smallest number of reports without motion that show a stalled wheel. ``AT_LEAST`` is for a
forward command. A backward command needs more: the board may repeat the speed of a rolling wheel,
and such a report does not show motion."""


class StallWatch:
    """Detector of stalled wheels. ``stalled`` reports a stalled wheel once in each ``STALLED_S``.

    ``may_roll``: for each wheel, whether it may roll although it seems stalled. This is so if the
    board repeats a speed that is too high for a wheel at rest.
    """

    def __init__(self, settings: LoisEcuSettings) -> None:
        self.settings = settings
        self._targets = [0, 0]
        self._seen_at = [math.inf, math.inf]
        self.may_roll = [False, False]
        self._quiet = [0, 0]
        """For each wheel: number of reports that could have shown a motion, but did not. It is set
        to zero by motion, by a command that starts or reverses the wheel, and when ``stalled``
        reports any wheel."""
        self._ticks: Ticks | None = None
        self._told: tuple[float, float] | None = None
        self._pose: tuple[float, float, float] | None = None

    def wrote(self, command: SetRpm | SetDuty, now: float) -> None:
        """Record a set-point. A wheel that is driven by duty is not checked."""
        targets = [0, 0]
        if isinstance(command, SetRpm):
            targets = [command.left_rpm, command.right_rpm]
        slowest_rpm = 60 * LEAST_TICKS / (STALLED_S * self.settings.ticks_per_revolution)
        for wheel, target in enumerate(targets):
            if abs(target) < max(LEAST_RPM, slowest_rpm):
                self._seen_at[wheel] = math.inf
            elif self._seen_at[wheel] == math.inf or target * self._targets[wheel] < 0:
                self._seen_at[wheel], self._quiet[wheel] = now, 0
                self.may_roll[wheel] = False
        self._targets = targets

    def heard(
        self,
        report: Ticks | BoardOdometry,
        now: float,
        resting: tuple[bool, bool] = (False, False),
    ) -> None:
        """Process a report: ticks, or the board's odometry.

        Ticks show forward motion. The board's odometry shows backward motion.

        ``resting``: which wheels the motion filter assumes to be at rest.
        """
        if isinstance(report, BoardOdometry):
            pose = (report.x_m, report.y_m, report.yaw_rad)
            told = rim_speeds(report, self.settings.track_m)
            for wheel in (0, 1):
                if self._targets[wheel] < 0:
                    turns = pose != self._pose and not self._repeats(wheel, told)
                    locked = resting[wheel] and self._lacks_power(wheel)
                    self._note(wheel, now, turns=turns and not locked)
            self._pose = pose
            if told is not None and any(told):
                self._told = told
            return
        before, self._ticks = self._ticks, report
        if before is not None:
            ticked = report.left != before.left, report.right != before.right
            for wheel in (0, 1):
                if self._targets[wheel] > 0 or ticked[wheel]:
                    self._note(wheel, now, turns=ticked[wheel])

    def stalled(self, now: float) -> tuple[bool, bool]:
        """Return, for each wheel, whether it is commanded but has not turned for ``STALLED_S``.

        If the result is True for a wheel, the times and report counts of both wheels begin again.
        """
        left, right = (
            now - seen_at >= STALLED_S and quiet >= (AT_LEAST_BACKWARD if target < 0 else AT_LEAST)
            for seen_at, quiet, target in zip(
                self._seen_at, self._quiet, self._targets, strict=True
            )
        )
        if left or right:
            self._seen_at = [at if at == math.inf else now for at in self._seen_at]
            self._quiet = [0, 0]
        return left, right

    def _repeats(self, wheel: int, told: tuple[float, float] | None) -> bool:
        """Return whether the board keeps reporting an old speed for ``wheel``.

        True if the speed is unchanged, and either the other wheel's speed has changed, or the speed
        is far above the set-point of ``wheel``.
        """
        if told is None or self._told is None:
            return False
        same = [abs(a - b) < SAME_MPS for a, b in zip(told, self._told, strict=True)]
        if abs(told[wheel]) <= SAME_MPS or not same[wheel]:
            return False
        # Far above the set-point, the controller gives no power. So a wheel that rolls would slow
        # down, and a repeated speed is that of a wheel at rest. Exceptions: a feed-forward gives
        # power at any speed, and a saturated controller may keep full power until RPM 0/0 restarts
        # it.
        repeats = self._too_fast(wheel, told) or not same[1 - wheel]
        fastest_mps = FASTEST_RPM * self.settings.rim_mps_per_rpm
        self.may_roll[wheel] |= repeats and abs(told[wheel]) > fastest_mps
        return repeats

    def _too_fast(self, wheel: int, told: tuple[float, float]) -> bool:
        """Return whether the reported speed is too high for a wheel that rolls steadily."""
        if self.settings.written.get(FEED_FORWARD[wheel]):
            return False
        target = abs(self._targets[wheel])
        most_mps = max(TOO_FAST * target, target + TOO_FAST_RPM) * self.settings.rim_mps_per_rpm
        if self._targets[1 - wheel] < 0:
            gain_mps = abs(told[1 - wheel] / self._targets[1 - wheel])
            most_mps = max(most_mps, UNLIKE * gain_mps * target)
        return abs(told[wheel]) > most_mps - SAME_MPS

    def _lacks_power(self, wheel: int) -> bool:
        """Return whether the controller gives a wheel no power.

        This is so if the reported speed is at or above the set-point.
        """
        told_mps = 0.0 if self._told is None else abs(self._told[wheel])
        return told_mps > abs(self._targets[wheel]) * self.settings.rim_mps_per_rpm - SAME_MPS

    def _note(self, wheel: int, now: float, *, turns: bool) -> None:
        self._quiet[wheel] += 1
        if turns and self._seen_at[wheel] != math.inf:
            self._seen_at[wheel], self._quiet[wheel] = now, 0
            self.may_roll[wheel] = False
