# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Whether a wheel stands that is commanded to turn: it may never start by itself.

In the eyes of the public firmware's controller a wheel that stands keeps its last speed. If that is
more than a new, slower set-point, the motor gets no power. RPM 0/0 clears it. Of a wheel that is to
turn backward 0x20 tells: its pose stands while nothing ticks, and while the other wheel ticks its
velocity shows the same speed of this one again and again. A wheel that rolls steadily does that
too, but not at a speed far above its set-point: there the controller gives it no power, so it would
become slower. Knows set-points, reports and times.
"""

import math
from typing import Final

from omnibot_driver.core.lois_ecu.board_odometry import rim_speeds
from omnibot_driver.core.lois_ecu.messages import BoardOdometry, SetDuty, SetRpm, Ticks

STALLED_S: Final = 2.0
"""Without a sign of motion. With the firmware's own gains a wheel takes half as long to start."""
LEAST_RPM: Final = 2
SAME_MPS: Final = 1e-3
TOO_FAST: Final = 1.2
TOO_FAST_RPM: Final = 3
"""A wheel that rolls backward is up to 10 % and one RPM faster than its set-point."""
AT_LEAST: Final = 4
"""This many groups must agree: on a bad line few arrive."""


class StallWatch:
    """``looks_stalled`` once for each ``STALLED_S`` that a commanded wheel stands."""

    def __init__(self, track_m: float = 0.47, rim_mps_per_rpm: float = 0.0136) -> None:
        self._track_m, self._rpm_mps = track_m, rim_mps_per_rpm
        self._targets = [0, 0]
        self._seen_at = [math.inf, math.inf]
        self._quiet = [0, 0]
        """Groups since then that could have shown this wheel's motion and did not."""
        self._ticks: Ticks | None = None
        self._told: tuple[float, float] | None = None
        self._pose: tuple[float, float, float] | None = None

    def wrote(self, command: SetRpm | SetDuty, now: float) -> None:
        """A set-point went out. Under duty there is no controller that could hold a wheel."""
        targets = [0, 0]
        if isinstance(command, SetRpm):
            targets = [command.left_rpm, command.right_rpm]
        for wheel, target in enumerate(targets):
            if abs(target) < LEAST_RPM:
                self._seen_at[wheel] = math.inf
            elif self._seen_at[wheel] == math.inf or target * self._targets[wheel] < 0:
                self._seen_at[wheel], self._quiet[wheel] = now, 0
        self._targets = targets

    def heard(self, report: Ticks | BoardOdometry, now: float) -> None:
        """A wheel that is to turn forward ticks; of one to turn backward the pose tells."""
        if isinstance(report, BoardOdometry):
            pose = (report.x_m, report.y_m, report.yaw_rad)
            told = rim_speeds(report, self._track_m)
            for wheel in (0, 1):
                if self._targets[wheel] < 0:
                    turns = pose != self._pose and not self._repeats(wheel, told)
                    self._note(wheel, now, turns=turns)
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

    def looks_stalled(self, now: float) -> bool:
        """Whether one of them has not turned for too long."""
        stalled = any(
            now - seen_at >= STALLED_S and quiet >= AT_LEAST
            for seen_at, quiet in zip(self._seen_at, self._quiet, strict=True)
        )
        if stalled:
            self._seen_at = [at if at == math.inf else now for at in self._seen_at]
            self._quiet = [0, 0]
        return stalled

    def _repeats(self, wheel: int, told: tuple[float, float] | None) -> bool:
        """Whether this wheel has the same speed as before, and the other one another, or this one
        is far too fast."""
        if told is None or self._told is None:
            return False
        same = [abs(a - b) < SAME_MPS for a, b in zip(told, self._told, strict=True)]
        target = abs(self._targets[wheel])
        most_mps = max(TOO_FAST * target, target + TOO_FAST_RPM) * self._rpm_mps
        too_fast = abs(told[wheel]) > most_mps - SAME_MPS
        return abs(told[wheel]) > SAME_MPS and same[wheel] and (too_fast or not same[1 - wheel])

    def _note(self, wheel: int, now: float, *, turns: bool) -> None:
        self._quiet[wheel] += 1
        if turns and self._seen_at[wheel] != math.inf:
            self._seen_at[wheel], self._quiet[wheel] = now, 0
