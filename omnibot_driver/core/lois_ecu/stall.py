# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Detection of a wheel that is commanded to turn but stands still: it may never start by itself.

For the public firmware's controller, a wheel at rest keeps its last speed. If that is more than a
new, slower set-point, the motor gets no power. RPM 0/0 clears it.

Ticks show a wheel that turns forward; 0x20 shows one that should turn backward. If that wheel is at
rest, the pose of 0x20 does not change while nothing ticks, and while the other wheel ticks its
velocity repeats the same speed of this one. A wheel that rolls steadily repeats a speed too, but
not far above its set-point: there the controller gives it no power, so it would become slower. Two
kinds of wheels are different. A feed-forward gives power at any speed. And a controller that was
saturated may keep full power, until RPM 0/0 starts it anew: such a wheel is faster than the last
speed of any wheel that comes to rest. Works on set-points, reports and times.
"""

import math
from typing import Final

from omnibot_driver.core.lois_ecu.board_odometry import rim_speeds
from omnibot_driver.core.lois_ecu.messages import BoardOdometry, SetDuty, SetRpm, Setting, Ticks
from omnibot_driver.core.lois_ecu.resting import FASTEST_RPM
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings

STALLED_S: Final = 2.0
"""Time in s without a sign of motion; with the firmware's own gains a wheel starts in half of
it."""
LEAST_RPM: Final = 2
SAME_MPS: Final = 1e-3
TOO_FAST: Final = 1.2
TOO_FAST_RPM: Final = 3
"""Limits above a set-point, as a factor and in RPM, beyond which a repeated speed is a kept one: a
wheel that rolls backward is up to 10 % and one RPM faster than its set-point."""
UNLIKE: Final = 1.15
"""Greatest ratio of the speeds, each over its set-point, of two wheels that roll backward."""
FEED_FORWARD: Final = (Setting.LEFT_FEED_FORWARD, Setting.RIGHT_FEED_FORWARD)
AT_LEAST: Final = 4
"""Number of groups that must agree, because few arrive on a bad line."""


class StallWatch:
    """Watch of both wheels; ``stalled`` once for each ``STALLED_S`` that one is at rest.

    ``settings`` may be replaced at any time. ``saturated``: whether each wheel's controller may be
    saturated, so that the wheel rolls.
    """

    def __init__(self, settings: LoisEcuSettings) -> None:
        self.settings = settings
        self._targets = [0, 0]
        self._seen_at = [math.inf, math.inf]
        self.saturated = [False, False]
        self._quiet = [0, 0]
        """Groups since then that could have shown this wheel's motion and did not."""
        self._ticks: Ticks | None = None
        self._told: tuple[float, float] | None = None
        self._pose: tuple[float, float, float] | None = None

    def wrote(self, command: SetRpm | SetDuty, now: float) -> None:
        """Record a set-point. A duty bypasses the controller, so it cannot stall a wheel."""
        targets = [0, 0]
        if isinstance(command, SetRpm):
            targets = [command.left_rpm, command.right_rpm]
        for wheel, target in enumerate(targets):
            if abs(target) < LEAST_RPM:
                self._seen_at[wheel] = math.inf
            elif self._seen_at[wheel] == math.inf or target * self._targets[wheel] < 0:
                self._seen_at[wheel], self._quiet[wheel] = now, 0
                self.saturated[wheel] = False
        self._targets = targets

    def heard(
        self,
        report: Ticks | BoardOdometry,
        now: float,
        resting: tuple[bool, bool] = (False, False),
    ) -> None:
        """Process a report: ticks show a forward wheel's motion, and odometry a backward one's."""
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
        """Return which commanded wheels have not turned for ``STALLED_S``; restart their time."""
        left, right = (
            now - seen_at >= STALLED_S and quiet >= AT_LEAST
            for seen_at, quiet in zip(self._seen_at, self._quiet, strict=True)
        )
        if left or right:
            self._seen_at = [at if at == math.inf else now for at in self._seen_at]
            self._quiet = [0, 0]
        return left, right

    def _repeats(self, wheel: int, told: tuple[float, float] | None) -> bool:
        """Return whether the board keeps reporting an old speed for this wheel.

        It does if the speed repeats, and either the other wheel's speed has changed or this speed
        is far above the set-point.
        """
        if told is None or self._told is None:
            return False
        same = [abs(a - b) < SAME_MPS for a, b in zip(told, self._told, strict=True)]
        if abs(told[wheel]) <= SAME_MPS or not same[wheel]:
            return False
        too_fast = self._too_fast(wheel, told)
        fastest_mps = FASTEST_RPM * self.settings.rim_mps_per_rpm
        self.saturated[wheel] |= too_fast and abs(told[wheel]) > fastest_mps
        return too_fast or not same[1 - wheel]

    def _too_fast(self, wheel: int, told: tuple[float, float]) -> bool:
        """Return whether no wheel can roll steadily at this reported speed."""
        if self.settings.written.get(FEED_FORWARD[wheel]):
            return False
        target = abs(self._targets[wheel])
        most_mps = max(TOO_FAST * target, target + TOO_FAST_RPM) * self.settings.rim_mps_per_rpm
        if self._targets[1 - wheel] < 0:
            gain_mps = abs(told[1 - wheel] / self._targets[1 - wheel])
            most_mps = max(most_mps, UNLIKE * gain_mps * target)
        return abs(told[wheel]) > most_mps - SAME_MPS

    def _lacks_power(self, wheel: int) -> bool:
        """Return whether the reported speed is that of the set-point or more."""
        told_mps = 0.0 if self._told is None else abs(self._told[wheel])
        return told_mps > abs(self._targets[wheel]) * self.settings.rim_mps_per_rpm - SAME_MPS

    def _note(self, wheel: int, now: float, *, turns: bool) -> None:
        self._quiet[wheel] += 1
        if turns and self._seen_at[wheel] != math.inf:
            self._seen_at[wheel], self._quiet[wheel] = now, 0
            self.saturated[wheel] = False
