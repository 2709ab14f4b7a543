# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Changes from one odometry report (0x20) to the next: turn, distance and wheel speeds.

The public firmware does not update its position while both wheels have the same speed.
"""

import math
from dataclasses import dataclass
from typing import Final

from omnibot_driver.core.lois_ecu.messages import BoardOdometry

WHOLE_RPM: Final = 0.1
MOST_RPM: Final = 150.0


@dataclass(frozen=True, slots=True)
class Told:
    """Changes between two consecutive odometry reports (0x20).

    * ``turned_m``: how much farther the right rim moved than the left one, in m.
    * ``along_m``: distance that the middle of the axle moved, in m.
    * ``still``, ``same_velocity``: whether pose and velocity are unchanged.
    * ``speeds_mps``: speeds of both rims, in m/s; None if they are not whole RPM.
    """

    turned_m: float
    along_m: float
    still: bool
    same_velocity: bool
    speeds_mps: tuple[float, float] | None


class OdometryReader:
    """Reader of odometry reports, which compares each report with the previous one.

    ``rpm_mps``: speed of a wheel's rim at 1 RPM, in m/s.
    """

    def __init__(self, track_m: float, rpm_mps: float) -> None:
        self._track_m, self._rpm_mps = track_m, rpm_mps
        self._before: BoardOdometry | None = None

    def begin(self) -> None:
        """Forget the last report, so that no change is computed for the next one."""
        self._before = None

    def take(self, group: BoardOdometry) -> Told | None:
        """Return what changed between the last report and the new report ``group``.

        Return None for the first report, and for a report whose pose is not finite.
        """
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
    """Return the speeds of the left and right rim in m/s, or None if the velocity is not finite."""
    along = group.dx_mps * math.cos(group.yaw_rad) + group.dy_mps * math.sin(group.yaw_rad)
    # After a rest between two ticks, the board computes one large turn for the time of the rest.
    # The velocity then points along the middle of this turn.
    forward = math.copysign(math.hypot(group.dx_mps, group.dy_mps), along)
    turning = group.yaw_rate_radps * track_m / 2
    if not (math.isfinite(forward) and math.isfinite(turning)):
        return None
    return forward - turning, forward + turning
