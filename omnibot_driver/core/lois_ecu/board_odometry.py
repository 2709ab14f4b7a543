# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What 0x20 tells from one group to the next: turned, rolled, and the speeds behind its velocity.

The public firmware integrates whole RPM of both wheels. Its way stands while both are equal, and
its velocity is that of the last tick. Knows groups; not when they came.
"""

import math
from dataclasses import dataclass
from typing import Final

from omnibot_driver.core.lois_ecu.messages import BoardOdometry

WHOLE_RPM: Final = 0.1
MOST_RPM: Final = 150.0


@dataclass(frozen=True, slots=True)
class Told:
    """Since the group before.

    ``turned_m``: way of the right rim less that of the left one; ``along_m``: of the middle of the
    axle. ``still``: neither changed. With the ``same_velocity`` too there was no tick, unless both
    speeds are equal. ``speeds_mps``: of the rims at the last tick, left and right, without the
    fraction of an RPM; None where the velocity tells none.
    """

    turned_m: float
    along_m: float
    still: bool
    same_velocity: bool
    speeds_mps: tuple[float, float] | None


class OdometryReader:
    """Reads odometry of a board with these wheels."""

    def __init__(self, track_m: float, rpm_mps: float) -> None:
        self._track_m, self._rpm_mps = track_m, rpm_mps
        self._before: BoardOdometry | None = None

    def begin(self) -> None:
        """The next group is a first one."""
        self._before = None

    def take(self, group: BoardOdometry) -> Told | None:
        """None for a first group, and for one that is not a number."""
        if not all(map(math.isfinite, (group.x_m, group.y_m, group.yaw_rad))):
            return None
        before, self._before = self._before, group
        if before is None:
            return None
        turned = group.yaw_rad - before.yaw_rad
        dx_m, dy_m = group.x_m - before.x_m, group.y_m - before.y_m
        middle = before.yaw_rad + turned / 2
        chord_m = dx_m * math.cos(middle) + dy_m * math.sin(middle)
        bend = math.sin(turned / 2) / (turned / 2) if abs(turned) > 1e-6 else 1.0
        velocity = (group.dx_mps, group.dy_mps, group.yaw_rate_radps)
        told_before = (before.dx_mps, before.dy_mps, before.yaw_rate_radps)
        still = turned == dx_m == dy_m == 0.0
        return Told(
            turned * self._track_m,
            chord_m / max(bend, 0.3),
            still,
            velocity == told_before,
            self._speeds(group),
        )

    def _speeds(self, group: BoardOdometry) -> tuple[float, float] | None:
        pair = rim_speeds(group, self._track_m)
        if pair is None:
            return None
        rpm = [speed / self._rpm_mps for speed in pair]
        whole = [round(number) if abs(number) < MOST_RPM else math.inf for number in rpm]
        if any(abs(a - b) > WHOLE_RPM for a, b in zip(rpm, whole, strict=True)):
            return None
        return whole[0] * self._rpm_mps, whole[1] * self._rpm_mps


def rim_speeds(group: BoardOdometry, track_m: float) -> tuple[float, float] | None:
    """Speeds of the left and right rim by the velocity; None where it is not a number."""
    along = group.dx_mps * math.cos(group.yaw_rad) + group.dy_mps * math.sin(group.yaw_rad)
    # Of a tick that took a rest the velocity points to the middle of a large turn.
    forward = math.copysign(math.hypot(group.dx_mps, group.dy_mps), along)
    turning = group.yaw_rate_radps * track_m / 2
    if not (math.isfinite(forward) and math.isfinite(turning)):
        return None
    return forward - turning, forward + turning
