# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""How both wheels move, and what the board's counters make of it, as one Kalman filter.

Of each wheel: its way, speed and acceleration, the ticks that should have counted, the speed that
the firmware measured last, and a bias. Of the body: its place, and the changes of 0x20's heading
and way. Errors of any of them are correlated with those of the place, so whatever the board tells
corrects the place as far as it can.

The wheels are the board's left and right; ways and speeds are those of nominal wheels. Knows the
commanded course and the firmware's counters; no messages.
"""

import math
from typing import Final

from omnibot_driver.core.lois_ecu.filter_history import FilterHistory
from omnibot_driver.core.lois_ecu.filter_variances import pose_covariance, twist_variances
from omnibot_driver.core.lois_ecu.sparse_filter import SparseFilter
from omnibot_driver.core.lois_ecu.wheel_motion import (
    ALONG,
    BIAS,
    COUNT,
    HELD,
    PER_WHEEL,
    PUSH,
    SPEED,
    STANDS_MPS,
    STATES,
    TURN,
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
"""What was not heard of for longer is not predicted any further."""
ROLLED_OUT_S: Final = 0.15
"""At the speed that it had, a wheel without power rolls on for about this time."""
LATE_PART: Final = 0.6
"""Of the controller's period: standard deviation of the time at which a command takes effect."""
START_TICKS: Final = 0.5
START_STDDEV_TICKS: Final = 0.9
"""What the measured speed misses of a wheel that starts and stops."""
ROUNDED: Final = 0.4
ROUNDED_STDDEV: Final = 0.15
"""Fraction of an RPM that the firmware drops, on average."""
DUTY_STDDEV: Final = 0.3
ROLLING_MPS: Final = 1e-6


class MotionFilter:
    """``tick_m``, ``rpm_mps``: of a rim; ``turn_sign``: -1 if the board's left wheel is the right
    one.

    signed: ticks count both ways, always. holds: a wheel that stands keeps its measured speed.
    reverse_gain: speed over target, backwards. unsettled_s: a wheel that is halted soon after a
    change of its set-point rolled at another speed than the model says, perhaps in the other
    direction: its way is off by this time that change.
    """

    def __init__(self) -> None:
        self.filter = SparseFilter(STATES)
        self.wheels = (Wheel(0), Wheel(PER_WHEEL))
        self.tick_m = self.rpm_mps = self.track_m = self.turn_sign = 1.0
        self.reverse_gain = 1.0
        self.unsettled_s = 0.0
        self.signed = self.holds = False
        self.yaw0_rad = 0.0
        self.differing_mps = math.inf
        """The least difference of both measured speeds since this was last set."""
        self._kinds: tuple[str, str] | None = None
        self.history = FilterHistory(self.filter)

    @property
    def yaw_rad(self) -> float:
        """Of the body."""
        mean = self.filter.mean
        return self.yaw0_rad + self.turn_sign * (mean[PER_WHEEL] - mean[WAY]) / self.track_m

    def speed_mps(self, wheel: int) -> float:
        """Of a rim."""
        return self.filter.mean[PER_WHEEL * wheel + SPEED]

    def way_m(self, wheel: int) -> float:
        """Rolled since the beginning."""
        return self.filter.mean[PER_WHEEL * wheel + WAY]

    def rounded_mps(self, wheel: int) -> float:
        """What the firmware drops of a measured speed."""
        if self.wheels[wheel].course.kind == "rpm":
            return self.filter.mean[BIAS + wheel]
        return ROUNDED * self.rpm_mps

    def shown_mps(self, wheel: int) -> float:
        """The speed that the firmware should have measured last, signed as it does."""
        held = self.filter.mean[PER_WHEEL * wheel + HELD] - self.rounded_mps(wheel)
        return self.wheels[wheel].course.measured_sign * max(held, 0.0)

    def pose_covariance(self) -> Covariance:
        """Of x, y and yaw."""
        return pose_covariance(self.filter, self.turn_sign / self.track_m)

    def twist_variances(self) -> tuple[float, float]:
        """Of the speed in (m/s)² and the turning in (rad/s)²."""
        return twist_variances(self.filter, self.track_m)

    @property
    def resting(self) -> bool:
        """Whether nothing is commanded and nothing moves."""
        return not any(
            wheel.course.target_mps or self.speed_mps(index)
            for index, wheel in enumerate(self.wheels)
        )

    def advance(self, from_s: float, to_s: float) -> None:
        """From then to then."""
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
        """The board restarted then, and the wheels have rolled out since.

        What was believed of the time after is taken back, and no set-point is in force. Where ticks
        count both ways they have begun at zero, and tell how far the wheels rolled out.
        """
        kept_s = self.history.go_back(then_s)
        if kept_s is None:
            return
        powered_s = max(min(then_s - kept_s, LONGEST_STEP_S), 0.0)
        for index, wheel in enumerate(self.wheels):
            speed = self.speed_mps(index)
            rolled_s = 0.0 if self.signed else ROLLED_OUT_S
            self.shift(index, speed * (powered_s + rolled_s), abs(speed) * ROLLED_OUT_S)
            if not self.signed:
                wheel.begin_again()
            for state in (SPEED, PUSH, HELD):
                self.filter.forget(wheel.base + state, 0.0, 0.0)

    def shift(self, index: int, way_m: float, stddev_m: float) -> None:
        """Move this wheel by ``way_m`` further than estimated."""
        terms = self._way_terms(index)
        for state, factor in terms:
            self.filter.mean[state] += factor * way_m
        self.filter.disturb(terms, stddev_m**2)

    def doubt(self, index: int, stddev_m: float, *, counted: bool = False) -> None:
        """The way of this wheel may be off by this, and all that follows from it; ``counted``: the
        way before it stopped counting.
        """
        wheel = self.wheels[index]
        terms = self._doubted(index)
        if counted and not wheel.counts(self.speed_mps(index), signed=self.signed):
            terms = [*self._way_terms(index), (wheel.base + COUNT, 1.0)]
        self.filter.disturb(terms, stddev_m**2)

    def _doubted(self, index: int) -> Terms:
        """What depends on a way of this wheel that was not measured."""
        wheel, base = self.wheels[index], PER_WHEEL * index
        terms = [*self._way_terms(index), (base + SPEED, 2.0)]
        counts = wheel.counts(self.speed_mps(index), signed=self.signed)
        if not counts and wheel.course.measured_sign:
            terms += [(TURN, 2.0 * index - 1), (ALONG, 0.5)]
        return terms

    def _way_terms(self, index: int) -> Terms:
        """What a way of this wheel changes."""
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
            cleared, changed = wheel.course.carry_out(now)
            if not (cleared or changed):
                continue
            speed = self.speed_mps(index)
            if cleared:
                if self.holds and not self.signed:
                    self.filter.disturb(doubted, (self.unsettled_s * wheel.unsettled_mps) ** 2)
                self.filter.forget(wheel.base + HELD, 0.0, 0.0)
                wheel.begin_anew(speed)
            step = abs(wheel.course.target_mps - speed)
            wheel.restless_mps = max(wheel.restless_mps, step)
            wheel.unsettled_mps = step if changed and wheel.course.target_mps else 0.0
            late_m = LATE_PART * wheel.course.step_s * speed
            self.filter.disturb(max(before, self._way_terms(index), key=len), late_m**2)
        kinds = (self.wheels[0].course.kind, self.wheels[1].course.kind)
        if kinds != self._kinds:
            self._kinds = kinds
            self._begin_biases()

    def _begin_biases(self) -> None:
        """Of a driven duty: relative; else what the firmware drops of a speed, in m/s."""
        for index, wheel in enumerate(self.wheels):
            if wheel.course.kind == "duty" and wheel.course.target_mps:
                self.filter.forget(BIAS + index, 0.0, DUTY_STDDEV**2)
            else:
                spread = ROUNDED_STDDEV * self.rpm_mps
                self.filter.forget(BIAS + index, ROUNDED * self.rpm_mps, spread**2)

    def _target(self, wheel: Wheel) -> float:
        target = wheel.course.target_mps
        if wheel.course.kind == "duty" or not target:
            return target
        if target < 0 and self.filter.mean[wheel.base + SPEED]:
            target *= self.reverse_gain  # its ticks lower the target; without ticks it stays
        return target + math.copysign(ROUNDED * self.rpm_mps, target)

    # Time

    def _step(self, dt: float) -> None:
        variances = {wheel.base: [(wheel.base + HELD, 1.0)] for wheel in self.wheels}
        unsure = {
            base: math.sqrt(self.filter.variance_of(held)) for base, held in variances.items()
        }
        step = Step(dt, list(self.filter.mean), unsure)
        before = (self.speed_mps(0), self.speed_mps(1))
        for wheel in self.wheels:
            wheel.roll(step, self._target(wheel), holds=self.holds, signed=self.signed)
        if abs(before[0]) + abs(before[1]) > ROLLING_MPS:
            self._measure_speeds(step, before)
        self._move(step)
        self.filter.propagate(step.rows)
        self.filter.mean = step.new
        for terms, variance in step.noises:
            self.filter.disturb(terms, variance)
        for index, wheel in enumerate(self.wheels):
            if abs(self.speed_mps(index)) < STANDS_MPS and not wheel.course.target_mps:
                self.filter.forget(wheel.base + SPEED, 0.0, 0.0)
                self.filter.forget(wheel.base + PUSH, 0.0, 0.0)

    def _measure_speeds(self, step: Step, before: tuple[float, float]) -> None:
        """What the firmware holds as speeds, and what 0x20 integrates of them.

        It does so at each tick of either wheel, so a wheel that alone rolls is measured as it is;
        one that stands beside it goes on with the speed that it had.
        """
        dt, new = step.dt, step.new
        turn: Terms = [(TURN, 1.0)]
        along: Terms = [(ALONG, 1.0)]
        told = [0.0, 0.0]
        for index, wheel in enumerate(self.wheels):
            base, sign, speed = wheel.base, wheel.course.measured_sign, abs(before[index])
            if not sign:
                continue
            side, forward = 2 * index - 1, math.copysign(1.0, before[index])
            if speed < STANDS_MPS <= abs(new[base + SPEED]):
                lost = sign * START_TICKS * self.tick_m
                new[TURN] -= side * lost
                new[ALONG] -= lost / 2
                spread = START_STDDEV_TICKS * self.tick_m
                step.noises.append(([(TURN, side), (ALONG, 0.5)], spread**2))
            fresh = speed / (abs(before[0]) + abs(before[1]))
            shown = fresh * speed + (1 - fresh) * new[base + HELD] - self.rounded_mps(index)
            if shown > 0.0:
                told[index] = sign * shown
                for terms, factor in ((turn, side * sign * dt), (along, sign * dt / 2)):
                    terms.append((base + SPEED, factor * fresh * forward))
                    terms.append((base + HELD, factor * (1 - fresh)))
                    if wheel.course.kind == "rpm":
                        terms.append((BIAS + index, -factor))
            renewed = 1 - math.exp(-speed * dt / self.tick_m)
            step.rows[base + HELD] = [(base + HELD, 1 - renewed), (base + SPEED, forward * renewed)]
            new[base + HELD] += renewed * (speed - new[base + HELD])
        new[TURN] += (told[1] - told[0]) * dt
        new[ALONG] += (told[1] + told[0]) / 2 * dt
        step.rows[TURN], step.rows[ALONG] = turn, along
        self.differing_mps = min(self.differing_mps, abs(told[1] - told[0]))

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
