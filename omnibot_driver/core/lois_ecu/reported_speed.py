# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Corrections of one wheel's estimated motion by the speeds that a LOIS ECU reports for the wheel.

The board keeps reporting the last speed of a stopped wheel, and measures wrong speeds while it
sends.

This module knows reported speeds and the motion filter; it does not know messages.
"""

import math
from typing import Final

from omnibot_driver.core.lois_ecu.motion_filter import MotionFilter
from omnibot_driver.core.lois_ecu.resting import RestingWheel
from omnibot_driver.core.lois_ecu.wheel_motion import BIAS, HELD, PUSH, SPEED, WINDUP_M, X, Y

ODOMETRY_AGE_S: Final = 0.0135
"""Assumed age in s of the values in an odometry report, when the report's last line arrives. The
board takes the values before it sends the first line."""
DOUBT: Final = 3.0
"""Largest usual difference between a reported and an expected value, in standard deviations. After
a larger difference, the filter increases the variance of its estimate."""
FASTER_RPM: Final = 2.5
"""Lowest reported speed in RPM that is used. A slower wheel may have rested between its last two
ticks."""
LONGEST_PAUSE_S: Final = 0.5
LONGEST_LAG_S: Final = 0.3
SPEED_PART: Final = 0.04
JUMP_RPM: Final = 8.0
JUMP_RPM_PER_S: Final = 200.0
"""``JUMP_RPM + JUMP_RPM_PER_S * duration``: largest plausible change, in RPM, between two reported
speeds that are ``duration`` s apart. After a larger change, the speed is rejected: the board has
noticed a tick late."""
FIRST_RPM: Final = 8.0
FIRST_PART: Final = 2.0
"""``FIRST_RPM + FIRST_PART * expected``: largest plausible first speed of a starting wheel, in RPM.

If the board reports a larger first speed, it is rejected. ``expected``: the expected speed in RPM.
"""
STRAY_RPM: Final = 2.0
STRAY_PART: Final = 0.1
"""``STRAY_RPM + STRAY_PART * expected``: largest plausible difference, in RPM, between a reported
and an expected speed. It applies if the set-point is constant, and the user has set the gains."""
COASTED_TICKS: Final = 1.0
"""Number of ticks that the driver subtracts from a wheel's distance when the wheel has come to
rest. The wheel has rolled less far than its last reported speed suggests."""
SWINGS_RPM: Final = 4.0
SWINGS_PART: Final = 0.4
"""Assumed duration of an unexpected change of speed, as a fraction of the time between two
reports."""
UNSEEN_PART: Final = 0.6
"""Largest assumed value of ``wound_m`` while a wheel does not tick, as a fraction of ``WINDUP_M``.

``wound_m`` is the integral of the speed controller. At ``WINDUP_M``, the wheel would start to move.
"""


class ReportedSpeed:
    """Corrects the motion filter ``motion`` by the speeds that the board reports for one wheel.

    ``index``: 0 for the left wheel, 1 for the right wheel.
    """

    def __init__(self, motion: MotionFilter, index: int) -> None:
        self._motion, self._index = motion, index
        self._wheel = motion.wheels[index]
        self._told = 0.0
        self._repeats = 0
        self._rejected_mps: float | None = None
        """The last reported speed, if it was rejected as implausible."""
        self._false = False
        """Whether the board keeps reporting a speed that the wheel never had."""
        self.misleads = False
        """Whether the board has computed its latest heading from a speed that the wheel did not
        have."""
        self._doubted_m = 0.0
        """Standard deviation in m that was added to the wheel's distance, because the wheel may be
        at rest. A change of the reported speed sets it to 0."""
        self.resting = RestingWheel()

    def note(self, duration_s: float) -> None:
        """Pass the wheel's estimated speed to ``resting``, because the board has reported no speed.

        ``duration_s``: for how long the board has reported no speed, in s.
        """
        if not self._wheel.rests:
            rpm = abs(self._motion.speed_mps(self._index)) / self._motion.rpm_mps
            self.resting.note(rpm, duration_s)

    def come_to_rest(self) -> None:
        """Record that the wheel is at rest, and subtract the distance that was added wrongly.

        This is the distance that was added since the wheel's last certain motion (``rolled_to_m``).
        """
        motion, wheel, tick_m = self._motion, self._wheel, self._motion.tick_m
        if wheel.rests:
            return
        wheel.rests = True
        sign = math.copysign(1.0, wheel.course.target_mps)
        rolled_m = motion.way_m(self._index) - wheel.rolled_to_m
        too_far_m = rolled_m + sign * COASTED_TICKS * tick_m
        motion.shift(self._index, -too_far_m, 2 * tick_m + abs(too_far_m) / 4)
        for state in (X, Y):  # the robot may have had another heading then
            motion.filter.disturb([(state, 1.0)], (too_far_m / 4) ** 2)
        motion.filter.forget(wheel.base + SPEED, 0.0, 0.0)
        motion.filter.forget(wheel.base + PUSH, 0.0, 0.0)

    def judge(self, speed_mps: float, duration_s: float) -> None:
        """Decide whether a reported speed is plausible. Call this before ``take``.

        After a rejected speed, a different speed is accepted without a check, because the board has
        measured anew.
        """
        motion, before_mps, misled = self._motion, self._rejected_mps, self._false
        self._rejected_mps, self._false, self.misleads = None, False, misled
        sign = self._wheel.course.measured_sign
        if not sign or speed_mps * sign < 0:
            return
        repeated = before_mps is not None and abs(speed_mps - before_mps) < 0.1 * motion.rpm_mps
        if before_mps is not None and not repeated:
            return
        rpm = abs(speed_mps) / motion.rpm_mps
        if self._jumps(rpm, duration_s) or self._starts_too_fast(rpm):
            self._rejected_mps = speed_mps
            self._false = repeated or not self._told
            self.misleads = misled or self._false

    def take(self, speed_mps: float, duration_s: float) -> None:
        """Correct the wheel's estimate by the speed that the board reports.

        The board measured this speed at the wheel's last encoder tick.
        ``duration_s``: time since the last report, in s.
        """
        motion, estimate = self._motion, self._motion.filter
        wheel, base = self._wheel, self._wheel.base
        rpm_mps, tick_m = motion.rpm_mps, motion.tick_m
        sign = wheel.course.measured_sign
        if not sign or speed_mps * sign < 0:
            self._told = speed_mps
            return
        if self._rejected_mps is not None:
            shown = abs(speed_mps) + motion.rounded_mps(self._index)
            estimate.forget(base + HELD, shown, rpm_mps**2 / 12)
            return
        before, self._told = self._told, speed_mps
        repeated = abs(speed_mps - before) < 0.1 * rpm_mps
        self._repeats = self._repeats + 1 if repeated else 0
        if motion.holds and wheel.course.kind == "rpm" and wheel.blind and speed_mps:
            self._rest(abs(speed_mps), duration_s, repeated=repeated)
            if wheel.rests:
                return
        expected = motion.speed_mps(self._index)
        ticked = not repeated or abs(expected) * duration_s > 3.0 * tick_m
        if not expected and motion.holds:
            if repeated:
                wheel.wound_m = min(wheel.wound_m, UNSEEN_PART * WINDUP_M)
                variance = (tick_m / max(duration_s, 0.01)) ** 2
                estimate.measure([(base + SPEED, 1.0)], 0.0, variance)
            elif not wheel.rolls_on:
                wheel.wound_m = WINDUP_M
        if wheel.rolls_on and not repeated and not wheel.rolls_on_s:
            wheel.rolls_on = ticked = False
        shown = abs(speed_mps) + (motion.rounded_mps(self._index) if speed_mps else 0.5 * rpm_mps)
        fast = shown > FASTER_RPM * rpm_mps and wheel.course.kind == "rpm"
        if not repeated and fast and wheel.rolls_on and wheel.rolls_on_s:
            self._rolls_at(math.copysign(shown, wheel.rolled_mps), duration_s)
        elif ticked and fast and not wheel.rolls_on:
            self._rolls_at(math.copysign(shown, sign), duration_s)
        estimate.forget(base + HELD, shown, rpm_mps**2 / 12)

    def _jumps(self, told_rpm: float, duration_s: float) -> bool:
        """Return whether a reported speed is implausible, because the board noticed a tick late."""
        motion, wheel = self._motion, self._wheel
        change_rpm = abs(told_rpm - abs(self._told) / motion.rpm_mps)
        if change_rpm > JUMP_RPM + JUMP_RPM_PER_S * duration_s:
            return True
        expected_rpm = abs(motion.speed_mps(self._index)) / motion.rpm_mps
        unsure_rpm = (
            math.sqrt(motion.filter.variance_of([(wheel.base + SPEED, 1.0)])) / motion.rpm_mps
        )
        strays = abs(told_rpm - expected_rpm) > STRAY_RPM + STRAY_PART * expected_rpm + unsure_rpm
        return motion.tuned and wheel.steady and strays

    def _starts_too_fast(self, told_rpm: float) -> bool:
        """Return whether the first reported speed of a starting wheel is implausible.

        The board's timer wraps every 6.6 s, so the board may report any speed after a long rest.
        """
        motion, wheel = self._motion, self._wheel
        if self._told or wheel.rolls_on or wheel.course.kind != "rpm":
            return False
        expected_rpm = abs(motion.speed_mps(self._index)) / motion.rpm_mps
        return told_rpm > FIRST_RPM + FIRST_PART * expected_rpm

    def _rest(self, told_mps: float, duration_s: float, *, repeated: bool) -> None:
        """Decide whether this wheel has come to rest, or rolls again."""
        motion, resting = self._motion, self.resting
        wheel, tick_m, speed = self._wheel, motion.tick_m, motion.speed_mps(self._index)
        sign = math.copysign(1.0, wheel.course.target_mps)
        resting.tell(told_mps / motion.rpm_mps, duration_s, tuned=motion.tuned)
        if not repeated:
            if wheel.rests:
                wheel.rests = False
                motion.shift(self._index, sign * tick_m, 2 * tick_m)
                spread = 2 * motion.rpm_mps + told_mps / 2
                motion.filter.forget(wheel.base + SPEED, sign * told_mps, spread**2)
            wheel.rolled_to_m = motion.way_m(self._index)
            self._doubted_m = 0.0
        elif resting.chance == 1.0 and not wheel.rests:
            self.come_to_rest()
        elif not wheel.rests and resting.chance:
            if motion.tuned:
                motion.doubt(self._index, resting.chance * abs(speed) * duration_s)
            else:
                self._doubt_rolling(resting.chance)

    def _doubt_rolling(self, chance: float) -> None:
        """Make the distance of a wheel less certain, because the wheel may be at rest.

        ``chance``: probability that the wheel is at rest. The board's odometry (0x20) cannot
        correct this error.
        """
        wrong_m = chance * abs(self._motion.way_m(self._index) - self._wheel.rolled_to_m)
        if wrong_m > self._doubted_m:
            more_m = math.sqrt(wrong_m**2 - self._doubted_m**2)
            self._motion.shift(self._index, 0.0, more_m)
            self._doubted_m = wrong_m

    def _rolls_at(self, speed_mps: float, duration_s: float) -> None:
        """Correct the wheel's estimated motion by a reported speed.

        ``speed_mps``: the reported speed, corrected for its rounding: the wheel's mean speed
        between its last two ticks, with sign. ``duration_s``: time since the last report, in s.
        """
        motion, estimate, base = self._motion, self._motion.filter, self._wheel.base
        push = estimate.mean[base + PUSH]
        lag_s = min(motion.tick_m / (2 * abs(speed_mps)) + ODOMETRY_AGE_S, LONGEST_LAG_S)
        terms = [
            (base + SPEED, 1.0),
            (base + PUSH, -lag_s),
            (BIAS + self._index, -math.copysign(1.0, speed_mps)),
        ]
        residual = speed_mps - (motion.speed_mps(self._index) - push * lag_s)
        variance = motion.rpm_mps**2 / 8 + (SPEED_PART * speed_mps) ** 2 + (push * lag_s) ** 2 / 4
        variance *= 1 + self._repeats**2
        wheel = self._wheel
        if wheel.blind and abs(residual) > SWINGS_RPM * motion.rpm_mps:
            motion.doubt(
                self._index, SWINGS_PART * abs(residual) * min(duration_s, LONGEST_PAUSE_S)
            )
        if residual**2 > DOUBT**2 * (estimate.variance_of(terms) + variance):
            estimate.disturb([(base + SPEED, 1.0)], (residual / 2) ** 2)
        estimate.measure(terms, residual, variance)
