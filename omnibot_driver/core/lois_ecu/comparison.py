# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Correction of the motion filter by the board's reports.

While the board counts a wheel's ticks, the count corrects the filter; otherwise, the board's
odometry (0x20) does.
"""

import math
from typing import Final

from omnibot_driver.core.lois_ecu.board_odometry import Told
from omnibot_driver.core.lois_ecu.motion_filter import MotionFilter
from omnibot_driver.core.lois_ecu.reported_speed import (
    DOUBT,
    LONGEST_LAG_S,
    LONGEST_PAUSE_S,
    ODOMETRY_AGE_S,
    ReportedSpeed,
)
from omnibot_driver.core.lois_ecu.resting import REPORT_S
from omnibot_driver.core.lois_ecu.wheel_motion import (
    ALONG,
    COUNT,
    HELD,
    PER_WHEEL,
    SPEED,
    TURN,
    X,
    Y,
)

TICKS_AGE_S: Final = 0.005
"""Assumed time in s from the reading of the counters by the board to the arrival of the last line
of the tick report."""
TICK_VARIANCE: Final = 1 / 8
TURN_VARIANCE: Final = 0.3
ALONG_VARIANCE: Final = 0.15
"""Variances of the errors of the board's reports, in squared ticks.

* ``TICK_VARIANCE``: tick count.
* ``TURN_VARIANCE``: heading in the board's odometry (0x20), as a difference of the distances of the
  two wheels.
* ``ALONG_VARIANCE``: distance in the board's odometry (0x20).
"""
COUNT_READ_S: Final = 0.003
UNFORESEEN_TICKS: Final = 1.5
"""Difference, in ticks, between a reported and an expected count, above which the filter assumes
that the wheel's speed has changed. The filter then allows for larger changes of the speed.
"""
UNFORESEEN: Final = 5.0
"""Limit for the difference between a reported and an expected count, in standard deviations.

The motion of a wheel cannot explain a larger difference, but a restart of the board can.
"""
SAME_TICKS: Final = 0.6
"""An unchanged count corrects the filter only if the expected count differs from it by at least
this number of ticks. Otherwise, the next tick may not be due yet.
"""
LEAP: Final = 5.0
LEAP_M: Final = 0.12
"""Limits for deviations of the board's odometry: ``LEAP`` in standard deviations, ``LEAP_M`` in m.

A distance is ignored if its deviation exceeds ``LEAP``. A turn, as the difference of the wheels'
distances, is ignored if its deviation exceeds both limits.
"""
DIFFERING_RPM: Final = 2.5
CREEPING_RPM: Final = 5.0
BLIND_M: Final = 0.012
SWINGING_M: Final = 0.055
"""Standard deviation, in m, of the error in a wheel's distance after 1 m without counted ticks.
``SWINGING_M`` is for an oscillating speed, ``BLIND_M`` for a steady speed."""
SWERVED_M: Final = 0.05
"""Standard deviation, in m, of the errors of the robot's x and y after a wheel has rolled 1 m.

Only for a wheel without counted ticks, at an oscillating speed.
"""
LOST_PART: Final = (0.15, 0.35)
"""Standard deviations of a distance rolled while reports were lost, as fractions of this distance.

The first is for a steady speed, the second for an oscillating one. Only for a wheel without counted
ticks.
"""
CORRECTED_TICKS: Final = 2.0
CORRECTED_PART: Final = 0.5
"""Standard deviation of a wheel's distance after a large correction, as a fraction of the excess.

The excess is the part of the correction above ``CORRECTED_TICKS`` (in ticks). Only for a wheel
without counted ticks.
"""
LATE_PART: Final = 0.6
"""Standard deviation of a wheel's distance after a late report, as a fraction of the distance
rolled during the delay. Only for a wheel without counted ticks.
"""
EQUAL_RPM: Final = 3.0
"""Standard deviation, in RPM, of the difference between the true speeds of the two wheels when the
board's odometry shows equal speeds."""


class Comparison:
    """Compares the board's reports with the estimate of the motion filter ``motion``.

    Each comparison also corrects this estimate.
    """

    def __init__(self, motion: MotionFilter) -> None:
        self._motion = motion
        self._counted_m = [0.0, 0.0]
        self._counted = [False, False]
        """For each wheel: whether the board counted the wheel's ticks when the last report arrived.

        Some boards count ticks only while a wheel is commanded forward.
        """
        self._turned_m = 0.0
        self._still_s = 0.0
        """How long the board's odometry (0x20) has shown no tick, in s."""
        self._speeds = ReportedSpeed(motion, 0), ReportedSpeed(motion, 1)

    # Ticks

    def begin_counts(self) -> None:
        """Restart each wheel's count of ticks at zero, both the reported and the expected one."""
        self._counted_m = [0.0, 0.0]
        variance = TICK_VARIANCE * self._motion.tick_m**2
        for wheel in self._motion.wheels:
            self._motion.filter.forget(wheel.base + COUNT, 0.0, variance)

    def unforeseen(self, index: int, ticks: int, late_s: float) -> tuple[float, bool]:
        """Return a wheel's reported count minus the expected one; 0 while ticks are not counted.

        Also return whether the difference (in ticks) is too large for an error of the motion
        filter. ``late_s``: how much later than usual the report arrived.
        """
        motion = self._motion
        wheel, speed = motion.wheels[index], motion.speed_mps(index)
        counts = wheel.counts(speed, signed=motion.signed)
        if not counts:
            return 0.0, False
        counted_m = self._counted_m[index] + ticks * motion.tick_m
        residual = counted_m - motion.filter.mean[wheel.base + COUNT]
        residual += (TICKS_AGE_S + late_s) * speed * counts
        variance = motion.filter.variance_of([(wheel.base + COUNT, 1.0)])
        unsure = variance + TICK_VARIANCE * motion.tick_m**2
        return residual / motion.tick_m, residual**2 > UNFORESEEN**2 * unsure

    def count(self, index: int, ticks: int, duration_s: float, late_s: float) -> None:
        """Correct the motion filter by ``ticks``, the newly counted ticks of a wheel.

        * ``duration_s``: time since the last report.
        * ``late_s``: how much later than usual the new report arrived.
        """
        motion, estimate = self._motion, self._motion.filter
        wheel, tick_m = motion.wheels[index], motion.tick_m
        self._counted_m[index] += ticks * tick_m
        speed = motion.speed_mps(index)
        counts = wheel.counts(speed, signed=motion.signed)
        counted, self._counted[index] = self._counted[index], bool(counts)
        if not counts and wheel.blind and not counted:
            if ticks:  # the robot is pushed
                self._counted_m[index] = estimate.mean[wheel.base + COUNT]
            return
        residual = self._counted_m[index] - estimate.mean[wheel.base + COUNT]
        residual += (TICKS_AGE_S + late_s) * speed * counts
        if not ticks and abs(residual) < SAME_TICKS * tick_m:
            return
        terms = [(wheel.base + COUNT, 1.0)]
        variance = TICK_VARIANCE * tick_m**2 + (COUNT_READ_S * speed) ** 2
        if residual**2 > DOUBT**2 * (estimate.variance_of(terms) + variance):
            motion.doubt(index, abs(residual), counted=counted)
        estimate.measure(terms, residual, variance)
        unforeseen_m = abs(residual) - UNFORESEEN_TICKS * tick_m
        if unforeseen_m > 0:
            wheel.restless_mps = max(wheel.restless_mps, unforeseen_m / max(duration_s, 0.1))

    # 0x20

    def begin_odometry(self) -> None:
        """Begin a new comparison with the board's odometry (0x20).

        From now on, the changes of the heading and of the distance are counted from zero.
        """
        self._turned_m = 0.0
        tick2 = self._motion.tick_m**2
        self._motion.filter.forget(TURN, 0.0, TURN_VARIANCE * tick2)
        self._begin_way(ALONG_VARIANCE * tick2)

    def _begin_way(self, variance: float) -> None:
        self._motion.filter.forget(ALONG, 0.0, variance)
        self._motion.differing_mps = math.inf

    def odometry(self, told: Told, duration_s: float, late_s: float) -> None:
        """Correct the motion filter by the changes in the board's odometry (0x20).

        ``duration_s``: time since the last such report. ``late_s``: how much later than usual the
        new report arrived.
        """
        motion = self._motion
        shown = motion.shown_mps(0), motion.shown_mps(1)
        for index, wheel in enumerate(motion.wheels):
            if wheel.blind and motion.holds:
                rolled_m = abs(motion.speed_mps(index)) * duration_s
                swings = wheel.rests or self._speeds[index].resting.swings
                part = SWINGING_M if swings else BLIND_M
                late_m = 0.0 if wheel.rests else LATE_PART * motion.speed_mps(index) * late_s
                lost_s = 0.0 if wheel.rests else max(duration_s - REPORT_S, 0.0)
                lost_m = LOST_PART[swings] * motion.speed_mps(index) * lost_s
                unseen_m = part * math.sqrt(min(rolled_m, 1.0))
                motion.shift(index, 0.0, math.hypot(unseen_m, late_m, lost_m))
                for state in (X, Y) if swings else ():
                    motion.filter.disturb([(state, 1.0)], SWERVED_M**2 * min(rolled_m, 1.0))
        # Neither wheel has ticked, or both wheels have the same speed.
        if told.still and told.same_velocity:
            moved = any(told.speeds_mps or ())
            if moved or max(map(abs, shown)) < CREEPING_RPM * motion.rpm_mps:
                self._no_tick(duration_s, 1.0 if moved else 2.0)
                return
        self._still_s = 0.0
        speeds_mps = () if self._equal(told, shown) else told.speeds_mps or ()
        for wheel_speed, speed_mps in zip(self._speeds, speeds_mps, strict=False):
            wheel_speed.judge(speed_mps, duration_s)
        rolling = abs(motion.speed_mps(0)) + abs(motion.speed_mps(1))
        pause_s = min(motion.tick_m / max(rolling, 0.01), LONGEST_PAUSE_S)
        self._turned_m += told.turned_m
        before_m = motion.way_m(0), motion.way_m(1)
        if speeds_mps and any(wheel_speed.misleads for wheel_speed in self._speeds):
            self.begin_odometry()
        else:
            self._turn(told, shown[1] - shown[0], pause_s, duration_s, late_s)
            self._along(told, sum(shown) / 2, pause_s)
        for index, wheel in enumerate(motion.wheels):
            corrected_m = abs(motion.way_m(index) - before_m[index])
            large_m = corrected_m - CORRECTED_TICKS * motion.tick_m
            if wheel.blind and large_m > 0.0:
                motion.shift(index, 0.0, CORRECTED_PART * large_m)
        for wheel_speed, speed_mps in zip(self._speeds, speeds_mps, strict=False):
            wheel_speed.take(speed_mps, duration_s)
        if told.speeds_mps and not speeds_mps:
            self._take_equal(duration_s)

    def came_to_rest(self, index: int) -> None:
        """Record that a wheel is at rest, and subtract the distance that was added wrongly.

        ``index``: 0 left, 1 right.
        """
        self._speeds[index].come_to_rest()

    def _equal(self, told: Told, shown: tuple[float, float]) -> bool:
        """Return whether both wheels have the same speed.

        In this case, the board's odometry shows the speed zero, although both wheels turn.
        ``shown``: for each wheel, the estimate of its last measured speed, in m/s.
        """
        left, right = (wheel.course.measured_sign for wheel in self._motion.wheels)
        differ = abs(shown[1] - shown[0]) > DIFFERING_RPM * self._motion.rpm_mps
        # The board keeps reporting the last speed of a wheel at rest. So speeds are compared only
        # after a tick.
        unknown = told.speeds_mps is not None and not any(told.speeds_mps)
        return unknown and left * right > 0 and not (differ and told.still)

    def _take_equal(self, duration_s: float) -> None:
        """Correct the motion filter: both wheels have the same speed.

        The board does not report the value of this speed.
        """
        motion = self._motion
        sure = not any(wheel.rests or wheel.locked or wheel.rolls_on for wheel in motion.wheels)
        if sure and not any(speed.resting.chance for speed in self._speeds):
            terms = [(SPEED, 1.0), (PER_WHEEL + SPEED, -1.0)]
            residual = motion.speed_mps(1) - motion.speed_mps(0)
            motion.filter.measure(terms, residual, (EQUAL_RPM * motion.rpm_mps) ** 2)
        for speed in self._speeds:
            speed.note(duration_s)

    def _no_tick(self, duration_s: float, ticks: float) -> None:
        """Correct the filter's wheel speeds towards zero after a report of odometry without a tick.

        ``ticks``: standard deviation of a wheel's distance since the last report, in ticks.
        """
        motion = self._motion
        self.begin_odometry()
        self._still_s += duration_s
        left_mps, right_mps = motion.shown_mps(0), motion.shown_mps(1)
        # With the next tick of either wheel, the board computes one turn for the whole pause.
        motion.filter.mean[TURN] = (right_mps - left_mps) * self._still_s
        motion.filter.mean[ALONG] = (right_mps + left_mps) / 2 * self._still_s
        variance = (ticks * motion.tick_m / max(duration_s, 0.01)) ** 2
        for index, wheel in enumerate(motion.wheels):
            speed = [(wheel.base + SPEED, 1.0)]
            if not wheel.course.unmeasured:
                motion.filter.measure(speed, -motion.speed_mps(index), variance)

    def _turn(
        self, told: Told, rate_mps: float, pause_s: float, duration_s: float, late_s: float
    ) -> None:
        motion, estimate = self._motion, self._motion.filter
        since_s = ODOMETRY_AGE_S + late_s + pause_s / 2
        residual = self._turned_m - (estimate.mean[TURN] - rate_mps * since_s)
        variance = TURN_VARIANCE * motion.tick_m**2 + (rate_mps * pause_s) ** 2 / 6
        for wheel, speed in zip(motion.wheels, told.speeds_mps or (), strict=False):
            if wheel.rolls_on and speed:
                other_mps = abs(speed) - estimate.mean[wheel.base + HELD]
                variance += (other_mps * min(duration_s, LONGEST_LAG_S)) ** 2
        unsure = estimate.variance_of([(TURN, 1.0)]) + variance
        doubtful = [
            index for index, wheel in enumerate(motion.wheels) if wheel.blind and not wheel.locked
        ]
        # A heading beyond both limits was computed from an outdated wheel speed.
        leaps = residual * residual > LEAP**2 * unsure and abs(residual) > LEAP_M
        if leaps or not doubtful:
            self.begin_odometry()
            return
        if residual * residual > DOUBT**2 * unsure:
            for index in doubtful:
                motion.doubt(index, abs(residual))
        estimate.measure([(TURN, 1.0)], residual, variance)

    def _along(self, told: Told, rate_mps: float, pause_s: float) -> None:
        motion, estimate = self._motion, self._motion.filter
        residual = told.along_m - estimate.mean[ALONG]
        variance = ALONG_VARIANCE * motion.tick_m**2 + (rate_mps * pause_s) ** 2 / 12
        # While both wheel speeds are equal, the public firmware does not change its position.
        whole = motion.differing_mps > DIFFERING_RPM * motion.rpm_mps
        beyond = residual * estimate.mean[ALONG] > 0
        unsure = estimate.variance_of([(ALONG, 1.0)]) + variance
        if (whole or beyond) and residual * residual < LEAP**2 * unsure:
            estimate.measure([(ALONG, 1.0)], residual, variance)
        self._begin_way(variance)
