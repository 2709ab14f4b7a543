# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Kalman filter of both wheels' motion, and of the values that the board reports.

Both wheels have the radius in the settings. The left wheel is the board's left wheel, which
is the robot's right wheel if the board is inverted.
"""

import math
from typing import Final

from omnibot_driver.core.lois_ecu.filter_history import FilterHistory
from omnibot_driver.core.lois_ecu.filter_variances import pose_covariance, twist_variances
from omnibot_driver.core.lois_ecu.measured_speed import measure_speeds
from omnibot_driver.core.lois_ecu.sparse_filter import SparseFilter
from omnibot_driver.core.lois_ecu.speed_errors import EXCESS_CHANGE, ROUNDED, SpeedErrors
from omnibot_driver.core.lois_ecu.wheel_motion import (
    ALONG,
    BIAS,
    COUNT,
    EXCESS,
    HELD,
    PER_WHEEL,
    PUSH,
    SPEED,
    STANDS_MPS,
    STATES,
    TURN,
    UNSETTLED_S,
    WAY,
    Step,
    Terms,
    Wheel,
    X,
    Y,
)
from omnibot_driver.core.odometry.covariance import Covariance

STEP_S: Final = 0.025
LONGEST_STEP_S: Final = 2.0
"""Longest time in s that one call of ``advance`` predicts. If more time has passed, ``advance``
skips the beginning, and predicts only the last ``LONGEST_STEP_S``.
"""
ROLLED_OUT_S: Final = 0.15
"""Assumed time in s for which a wheel rolls on at its last speed after it has lost power."""
LATE_PART: Final = 0.6
"""Assumed standard deviation of the time at which a command takes effect, as a fraction of the
speed controller's period."""
ROLLS_S: Final = 0.1
"""Standard deviation of the time in s that a wheel rolls on after its controller was reset.

An RPM set-point can reset the controller, which cuts the power. Motors and friction are unknown.
"""
REVERSES_S: Final = 0.2
"""Standard deviation, in s, of the time that a wheel needs to stop when its duty changes sign. The
board does not measure the direction of a wheel.
"""
ROLLING_MPS: Final = 1e-6


class MotionFilter:
    """Estimate of the wheels' motion and the body's pose.

    * ``rpm_mps``: speed of a wheel's rim at one RPM.
    * ``turn_sign``: -1 if the board's left wheel is the robot's right wheel, otherwise 1.
    * ``signed``: whether ticks always count in both directions.
    * ``holds``: whether the board keeps the last measured speed of a wheel at rest.
    * ``tuned``: whether the user set the gains of the speed controllers.
    """

    def __init__(self) -> None:
        # ``wheel_motion`` lists the states. Their errors are correlated with that of the position,
        # so each report also corrects the position.
        self.filter = SparseFilter(STATES)
        self.wheels = (Wheel(0), Wheel(PER_WHEEL))
        self.tick_m = self.rpm_mps = self.track_m = self.turn_sign = 1.0
        self.tuned = self.signed = self.holds = False
        self.yaw0_rad = 0.0
        self.differing_mps = math.inf
        """Smallest estimated difference (m/s) of measured wheel speeds since the last comparison.

        The comparison uses the board's distance. While both speeds are equal, the public firmware
        does not update its position, so this distance may be too short.
        """
        self.speed_errors = SpeedErrors(self)
        self.history = FilterHistory(self.filter)

    @property
    def yaw_rad(self) -> float:
        """Yaw of the body, in rad."""
        mean = self.filter.mean
        return self.yaw0_rad + self.turn_sign * (mean[PER_WHEEL] - mean[WAY]) / self.track_m

    def speed_mps(self, wheel: int) -> float:
        """Return the speed of a wheel's rim, in m/s."""
        return self.filter.mean[PER_WHEEL * wheel + SPEED]

    def way_m(self, wheel: int) -> float:
        """Return the distance that a wheel has rolled since the odometry was reset, in m."""
        return self.filter.mean[PER_WHEEL * wheel + WAY]

    def rounded_mps(self, wheel: int) -> float:
        """Return by how much the firmware rounds down a wheel's measured speed, in m/s."""
        if self.wheels[wheel].course.kind == "rpm":
            return self.filter.mean[BIAS + wheel]
        return ROUNDED * self.rpm_mps

    def shown_mps(self, wheel: int) -> float:
        """Return an estimate of the speed that the firmware measured last, in m/s, with sign."""
        held = self.filter.mean[PER_WHEEL * wheel + HELD] - self.rounded_mps(wheel)
        return self.wheels[wheel].course.measured_sign * max(held, 0.0)

    def pose_covariance(self) -> Covariance:
        """Return the covariance of x, y and yaw."""
        return pose_covariance(self.filter, self.turn_sign / self.track_m)

    def twist_variances(self, now: float) -> tuple[float, float]:
        """Return the variances of the speed in (m/s)² and of the yaw rate in (rad/s)²."""
        left, right = (wheel.coasting.unsure_mps(now, wheel.course.step_s) for wheel in self.wheels)
        return twist_variances(self.filter, self.track_m, (left, right))

    @property
    def resting(self) -> bool:
        """Whether both wheels have a target of zero and an estimated speed of zero."""
        return not any(
            wheel.course.target_mps or self.speed_mps(index)
            for index, wheel in enumerate(self.wheels)
        )

    def advance(self, from_s: float, to_s: float) -> None:
        """Predict the motion from ``from_s`` to ``to_s``."""
        at_s = max(from_s, to_s - LONGEST_STEP_S)
        while at_s < to_s:
            self._take_effect(at_s)
            change_s = min(wheel.course.next_change_s() for wheel in self.wheels)
            if self.resting:
                at_s = max(min(change_s, to_s), at_s + 1e-4)
                continue
            end_s = max(min(at_s + STEP_S, to_s, change_s), at_s + 1e-4)
            self._step(end_s - at_s)
            at_s = end_s

    def restart(self, then_s: float) -> None:
        """Restore the state at the time ``then_s`` of the board's restart.

        Later states are discarded.
        """
        kept_s = self.history.go_back(then_s)
        if kept_s is None:
            return
        self.speed_errors.restored()
        # A restarted board does not drive, so the wheels coast. Signed counts restart at zero and
        # show how far. Otherwise the distance is estimated.
        powered_s = max(min(then_s - kept_s, LONGEST_STEP_S), 0.0)
        for index, wheel in enumerate(self.wheels):
            speed = self.speed_mps(index)
            rolled_s = 0.0 if self.signed else ROLLED_OUT_S
            unsure_s = math.hypot(ROLLED_OUT_S, powered_s / 2)
            self.shift(index, speed * (powered_s + rolled_s), abs(speed) * unsure_s)
            if not self.signed:
                wheel.begin_again()
            wheel.rolled_to_m = self.way_m(index)
            for state in (SPEED, PUSH, HELD):
                self.filter.forget(wheel.base + state, 0.0, 0.0)

    def shift(self, index: int, way_m: float, stddev_m: float) -> None:
        """Add ``way_m`` (standard deviation ``stddev_m``) to a wheel's estimated distance."""
        terms = self._way_terms(index)
        for state, factor in terms:
            self.filter.mean[state] += factor * way_m
        self.filter.disturb(terms, stddev_m**2)

    def doubt(self, index: int, stddev_m: float, *, counted: bool = False) -> None:
        """Increase the uncertainty of a wheel's distance, and of all states that depend on it.

        ``stddev_m``: standard deviation to add. ``counted``: whether the board counted the wheel's
        ticks when the error arose; the count then becomes uncertain too.
        """
        wheel = self.wheels[index]
        terms = self._doubted(index)
        if counted and not wheel.counts(self.speed_mps(index), signed=self.signed):
            terms = [*self._way_terms(index), (wheel.base + COUNT, 1.0)]
        self.filter.disturb(terms, stddev_m**2)

    def doubt_way(self, index: int, stddev_m: float) -> None:
        """Increase the uncertainty of a wheel's distance, but not of its tick count."""
        terms = [term for term in self._way_terms(index) if term[0] != PER_WHEEL * index + COUNT]
        self.filter.disturb(terms, stddev_m**2)

    def doubt_place(self, stddev_m: float) -> None:
        """Increase the uncertainty of the robot's position.

        The uncertainty of its heading and of its wheels' distances stays the same.
        """
        for state in (X, Y):
            self.filter.disturb([(state, 1.0)], stddev_m**2)

    def _doubted(self, index: int) -> Terms:
        """Return the error of each state of the filter if a wheel's distance is wrong by 1 m.

        States without an error are left out.
        """
        wheel, base = self.wheels[index], PER_WHEEL * index
        terms = self._way_terms(index)
        if not wheel.rests:
            terms = [*terms, (base + SPEED, 2.0)]
        counts = wheel.counts(self.speed_mps(index), signed=self.signed)
        if not counts and wheel.course.measured_sign:
            terms += [(TURN, 2.0 * index - 1), (ALONG, 0.5)]
        return terms

    def _way_terms(self, index: int) -> Terms:
        """Return the states that change if a wheel rolls 1 m, each with the size of its change."""
        base, yaw = PER_WHEEL * index, self.yaw_rad
        terms = [(base + WAY, 1.0), (X, math.cos(yaw) / 2), (Y, math.sin(yaw) / 2)]
        counts = self.wheels[index].counts(self.speed_mps(index), signed=self.signed)
        return [*terms, (base + COUNT, counts)] if counts else terms

    # Commands

    def _take_effect(self, now: float) -> None:
        for index, wheel in enumerate(self.wheels):
            if wheel.course.next_change_s() > now:
                continue
            before, doubted = self._way_terms(index), self._doubted(index)
            starts = not wheel.course.target_mps
            cleared, changed = wheel.course.carry_out(now)
            if cleared or (changed and starts):
                wheel.rolled_to_m = self.way_m(index)
            if not (cleared or changed):
                continue
            speed = self.speed_mps(index)
            if cleared:
                # A wheel that halts soon after a new set-point did not yet roll at the modelled
                # speed. So its distance gets an error.
                if self.holds and not self.signed:
                    unsettled_s = UNSETTLED_S[self.tuned]
                    self.filter.disturb(doubted, (unsettled_s * wheel.unsettled_mps) ** 2)
                self.filter.forget(wheel.base + HELD, 0.0, 0.0)
                wheel.begin_anew(speed)
            step = abs(wheel.course.target_mps - speed)
            wheel.restless_mps = max(wheel.restless_mps, step)
            wheel.unsettled_mps = step if changed and wheel.course.target_mps else 0.0
            if wheel.course.target_mps < 0 and wheel.course.kind == "rpm":
                part = min(step / -wheel.course.target_mps, 1.0)
                variance = (EXCESS_CHANGE[self.tuned] * part) ** 2
                self.filter.disturb([(EXCESS + index, 1.0)], variance)
            late_m = LATE_PART * wheel.course.step_s * speed
            if cleared:
                late_m = math.hypot(late_m, ROLLS_S * speed)
            if wheel.course.kind == "duty" and wheel.course.target_mps * speed < 0:
                late_m = math.hypot(late_m, REVERSES_S * speed)
            self.filter.disturb(max(before, self._way_terms(index), key=len), late_m**2)
        self.speed_errors.follow()

    def _target(self, wheel: Wheel) -> float:
        target = wheel.course.target_mps
        if wheel.course.kind == "duty" or not target:
            return target
        if target < 0 and self.filter.mean[wheel.base + SPEED]:
            target *= 1.0 + self.filter.mean[EXCESS + wheel.base // PER_WHEEL]
        return target + math.copysign(ROUNDED * self.rpm_mps, target)

    # Time

    def _step(self, dt: float) -> None:
        unsure = {
            wheel.base: math.sqrt(self.filter.variance_of([(wheel.base + HELD, 1.0)]))
            for wheel in self.wheels
        }
        step = Step(dt, list(self.filter.mean), unsure)
        before = (self.speed_mps(0), self.speed_mps(1))
        for wheel in self.wheels:
            wheel.roll(step, self._target(wheel), holds=self.holds, signed=self.signed)
        if abs(before[0]) + abs(before[1]) > ROLLING_MPS or any(map(self.shown_mps, (0, 1))):
            measure_speeds(self, step, before)
        self._move(step)
        self.filter.propagate(step.rows)
        self.filter.mean = step.new
        for terms, variance in step.noises:
            self.filter.disturb(terms, variance)
        for index, wheel in enumerate(self.wheels):
            if abs(self.speed_mps(index)) < STANDS_MPS and not wheel.course.target_mps:
                self.filter.forget(wheel.base + SPEED, 0.0, 0.0)
                self.filter.forget(wheel.base + PUSH, 0.0, 0.0)

    def _move(self, step: Step) -> None:
        mean, new = self.filter.mean, step.new
        left_m, right_m = (new[wheel.base + WAY] - mean[wheel.base + WAY] for wheel in self.wheels)
        way = (left_m + right_m) / 2
        turned = self.turn_sign * (right_m - left_m) / self.track_m
        middle = self.yaw_rad + turned / 2
        cos, sin = math.cos(middle), math.sin(middle)
        new[X] += way * cos
        new[Y] += way * sin
        swing, half = self.turn_sign * way / self.track_m, step.dt / 2
        for state, part, across in ((X, cos, -sin * swing), (Y, sin, cos * swing)):
            step.rows[state] = [
                (state, 1.0),
                (SPEED, part * half),
                (PER_WHEEL + SPEED, part * half),
                (WAY, -across),
                (PER_WHEEL + WAY, across),
            ]
