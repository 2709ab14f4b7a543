# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The board's own odometry, as the manual describes it and as the firmware computes it.

This module does not know the true pose of the robot.
"""

from math import cos, inf, nan, pi, sin

from omnibot_driver.simulator.lois_ecu.settings import LoisSettings

TIMER_COUNTS = 0x10000
COUNT_S = 1e-4
SLOW_COUNT_S = 7251 / 72e6


class DocumentedOdometry:
    """Odometry from signed ticks and measured speeds, as the manual describes it.

    * ``pose``: x and y in m, and yaw in rad.
    * ``velocity``: in m/s, m/s and rad/s, along the fixed axes, not the robot's axes.
    """

    def __init__(self, steps: int, radius_m: float, track_m: float) -> None:
        self._tick_m = 2 * pi * radius_m / steps
        self._rim_mps = 2 * pi * radius_m / 60
        self._track_m = track_m
        self.clear()

    def clear(self) -> None:
        """Return to the origin, at rest."""
        self.pose = (0.0, 0.0, 0.0)
        self.velocity = (0.0, 0.0, 0.0)

    def move(self, left_ticks: int, right_ticks: int) -> None:
        """Move the pose by the given numbers of new ticks."""
        if not (left_ticks or right_ticks):
            return
        way = (left_ticks + right_ticks) * self._tick_m / 2
        turn = (right_ticks - left_ticks) * self._tick_m / self._track_m
        x, y, yaw = self.pose
        middle = yaw + turn / 2
        self.pose = (x + way * cos(middle), y + way * sin(middle), yaw + turn)

    def measure(self, left_rpm: float, right_rpm: float) -> None:
        """Set the velocity from the measured wheel speeds in RPM."""
        speed = (left_rpm + right_rpm) / 2 * self._rim_mps
        turning = (right_rpm - left_rpm) * self._rim_mps / self._track_m
        yaw = self.pose[2]
        self.velocity = (speed * cos(yaw), speed * sin(yaw), turning)


class FirmwareOdometry(DocumentedOdometry):
    """Odometry as the firmware computes it: at each encoder tick, from the latest RPMs.

    Each of these arguments switches one fault of the firmware on:

    * ``stands``: the position does not change while both RPMs are equal.
    * ``divides``: the velocity is NaN or infinite if two ticks have the same time.
    * ``slow``: each count of the timer takes 0.7 % too long.
    """

    def __init__(
        self,
        steps: int,
        radius_m: float,
        track_m: float,
        *,
        stands: bool,
        divides: bool,
        slow: bool,
    ) -> None:
        super().__init__(steps, radius_m, track_m)
        self._stands, self._divides = stands, divides
        self._timer_s = SLOW_COUNT_S if slow else COUNT_S
        self._count: int | None = None

    def tick(self, at_s: float, left_rpm: int, right_rpm: int) -> None:
        """Process one encoder edge of either wheel at ``at_s``."""
        count = int(at_s / self._timer_s) % TIMER_COUNTS
        before, self._count = self._count, count
        if before is None:
            return
        passed_s = (count - before) % TIMER_COUNTS * COUNT_S
        left, right = left_rpm * self._rim_mps, right_rpm * self._rim_mps
        turn = (right - left) / self._track_m * passed_s
        way = (left + right) / 2 * passed_s
        if left == right and self._stands:
            way = 0.0
        x, y, yaw = self.pose
        middle = yaw + turn / 2
        new = (x + way * cos(middle), y + way * sin(middle), yaw + turn)
        if passed_s or self._divides:
            rates = [
                _quotient(after - old, passed_s) for after, old in zip(new, self.pose, strict=True)
            ]
            self.velocity = (rates[0], rates[1], rates[2])
        self.pose = new


def odometry_of(settings: LoisSettings) -> DocumentedOdometry:
    """Return the odometry of the firmware that ``settings.quirks`` describes."""
    geometry = settings.steps, settings.wheel_radius_m, settings.track_m
    quirks = settings.quirks
    stands, divides = quirks.odometry_stands_at_equal_speeds, quirks.velocity_may_be_nan
    if stands or divides or quirks.keeps_speed_of_stalled_wheel:
        return FirmwareOdometry(*geometry, stands=stands, divides=divides, slow=quirks.slow_timer)
    return DocumentedOdometry(*geometry)


def _quotient(way: float, time_s: float) -> float:
    if time_s:
        return way / time_s
    return nan if not way else inf if way > 0 else -inf
