# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Motion of a wheel under its commands, as a step of the motion filter.

Input: commands and the filter's states of one wheel; output: the states after the step.
"""

import math
from dataclasses import dataclass, field
from typing import Final

from omnibot_driver.core.lois_ecu.coasting import COAST_PART, COASTING_S, DRY_MPS2, Coasting
from omnibot_driver.core.lois_ecu.wheel_model import HEARD_S, CommandKind, WheelModel

WAY, SPEED, PUSH, COUNT, HELD = range(5)
PER_WHEEL: Final = 5
"""Number of states of a wheel. The states are: distance in m, speed in m/s, acceleration in m/s²,
distance in m that the tick count shows, and last measured speed in m/s."""
X, Y, TURN, ALONG, BIAS, EXCESS = 10, 11, 12, 13, 14, 16
"""Indices of the body's states. ``BIAS`` and ``EXCESS`` are those of the left wheel; those of the
right wheel follow.

* ``X``, ``Y``: position in m.
* ``TURN``: distance of the right wheel minus that of the left wheel, in m.
* ``ALONG``: mean distance of both wheels, in m.
* ``BIAS``: error of a wheel's speed: relative in duty mode, otherwise in m/s.
* ``EXCESS``: fraction of the set-point by which a wheel that rolls backward is too fast.
"""
STATES: Final = 18

CONTROL_RATE: Final = 2.0
"""Assumed rate in 1/s at which the controller reaches a target speed, critically damped."""
# The user's gains and motors are unknown, so the assumed noise is large.
PUSH_PER_SPEED: Final = 2.2
"""Ratio, in 1/s, of the assumed standard deviation of a wheel's acceleration to ``restless_mps``.
``restless_mps`` is the largest recent difference between the wheel's speed and its target."""
SETTLING_S: Final = 1.5
ROUGH: Final = 7e-4
"""Variance that uneven ground adds to a wheel's speed, in (m/s)² per s."""
WINDUP_M: Final = 0.08
"""Value, in m, of the speed controller's integral at which a wheel at rest starts to move. The
integral is that of target minus measured speed."""
DUTY_S: Final = 0.15
DUTY_PART: Final = 0.3
ROLLS_ON_S: Final = 0.35
ROLLED_OUT_S: Final = 1.0
"""Longest assumed time in s for which a wheel rolls on after its set-point changed sign."""
UNSETTLED_S: Final = (0.27, 0.06)
"""Standard deviation of the distance of a wheel that halts soon after a new set-point.

The unit is m per m/s of the speed error at this set-point (``unsettled_mps``). The first value is
for the board's gains, the second for the user's.
"""
STEADY_PART: Final = 0.2
STANDS_MPS: Final = 0.01
FADED_MPS: Final = 1e-4

Terms = list[tuple[int, float]]


@dataclass(slots=True)
class Step:
    """One step of the filter over ``dt`` s.

    * ``new``: means of the states after the step.
    * ``unsure_mps``: for each wheel, standard deviation of its last measured speed. The key is the
      index of the wheel's first state.
    * ``rows``: the rows of the transition matrix that differ from the identity matrix, by the index
      of the state.
    * ``noises``: independent errors of the step. Each has a list of the states that it changes,
      with their factors, and a variance.
    """

    dt: float
    new: list[float]
    unsure_mps: dict[int, float]
    rows: dict[int, Terms] = field(default_factory=dict)
    noises: list[tuple[Terms, float]] = field(default_factory=list)


class Wheel:
    """Properties of one wheel that are not states of the motion filter.

    * ``base``: index of the wheel's first state in the filter.
    * ``blind``: whether the wheel moved, or was to move, while the board did not count its ticks.
      The caller resets it to False.
    """

    def __init__(self, base: int) -> None:
        self.base = base
        self.course = WheelModel()
        self.rolled_to_m = 0.0
        """Distance in m that the wheel had rolled when its motion was last certain. If the wheel
        proves to have been at rest since then, the driver subtracts the distance added after that
        moment."""
        self.begin_again()

    def begin_again(self) -> None:
        """Forget all commands and history, because the board has just started."""
        self.course = WheelModel(self.course.step_s)
        self.coasting = Coasting(-math.inf, 0.0)
        """How the wheel coasts after the last command that stopped or reversed it."""
        self.restless_mps = 0.0
        """Largest recent difference between target and speed, in m/s. It decays with time."""
        self.unsettled_mps = 0.0
        """Difference between target and speed when the last new set-point took effect, in m/s. It
        decays with time."""
        self.wound_m = 0.0
        """Integral of target minus measured speed since the controller was reset, in m."""
        self.cut = False
        """Whether the wheel still has no power after a reset of its speed controller.

        The wheel gets power again when ``wound_m``, the controller's integral, is large enough.
        """
        self.rolls_on = False
        """Whether the reported speed may still belong to the motion before the last reset of the
        controller."""
        self.rolls_on_s = 0.0
        self.rolled_mps = 0.0
        self.rolled_s = math.inf
        """Time in s since the last reset of the wheel's speed controller.

        After the reset, the wheel may roll on. ``rolled_mps``: speed of the wheel at the reset, in
        m/s.
        """
        self.locked = False
        """Whether the wheel is at rest, and cannot start because its controller gives no power.

        The controller still uses the last speed before the standstill, and this speed exceeds the
        target.
        """
        self.rests = False
        """Whether the driver has concluded that the wheel is at rest.

        It can conclude this, for example, when the board repeats the same measured speed.
        """
        self.blind = False

    def command(self, at_s: float, kind: CommandKind, target_mps: float, speed_mps: float) -> None:
        """Record that a command was written at ``at_s`` while the wheel had ``speed_mps``."""
        if target_mps * speed_mps <= 0 < self.course.commanded_mps * speed_mps:
            self.coasting = Coasting(at_s + HEARD_S, speed_mps)
        self.course.command(at_s, kind, target_mps)

    def begin_anew(self, speed_mps: float) -> None:
        """Record that the controller was reset while the wheel had the speed ``speed_mps``."""
        self.cut, self.wound_m = True, 0.0
        self.rests = False
        self.rolled_mps, self.rolled_s = speed_mps, 0.0
        if abs(speed_mps) > STANDS_MPS:
            self.rolls_on, self.rolls_on_s = True, ROLLS_ON_S

    @property
    def steady(self) -> bool:
        """Whether the set-point has been constant for long enough for the wheel to reach it."""
        return self.restless_mps < STEADY_PART * abs(self.course.target_mps)

    def counts(self, speed_mps: float, *, signed: bool) -> float:
        """Return the factor by which motion of the wheel changes the tick count: 1, -1 or 0.

        0: the board does not count. ``signed``: whether the count decreases when the wheel rolls
        backward. If True, the factor is always 1.
        """
        if signed:
            return 1.0
        if not self.course.counting:
            return 0.0
        rolls_back = speed_mps < 0 and self.rolled_mps < 0 and self.rolled_s < ROLLED_OUT_S
        # An unsigned count increases even while the wheel rolls backward.
        return -1.0 if rolls_back else 1.0

    def roll(self, step: Step, target_mps: float, *, holds: bool, signed: bool) -> None:
        """Predict the motion of the wheel in one step of the filter, and store it in ``step``.

        ``holds``: whether the board keeps the last measured speed of a wheel at rest. ``signed``:
        whether the tick count decreases when the wheel rolls backward.
        """
        base, dt, new = self.base, step.dt, step.new
        speed = new[base + SPEED]
        self.rolled_s += dt
        # A duty brakes a wheel that rolls the other way. An RPM target lets it coast first.
        against = target_mps * speed < 0 and self.course.kind == "rpm"
        if against and (speed * self.rolled_mps <= 0 or self.rolled_s > ROLLED_OUT_S):
            speed = new[base + SPEED] = new[base + PUSH] = 0.0  # no wheel starts the wrong way
        counts = self.counts(speed, signed=signed)
        if not target_mps or (speed and (against or self.cut)):
            self._coast(step, target_mps, holds=holds)
        elif self.course.kind == "duty":
            self._by_duty(step, target_mps)
        else:
            self._controlled(step, target_mps, holds=holds)
        way = (speed + new[base + SPEED]) / 2 * dt
        new[base + WAY] += way
        step.rows[base + WAY] = [(base + WAY, 1.0), (base + SPEED, dt)]
        if counts:
            new[base + COUNT] += counts * way
            step.rows[base + COUNT] = [(base + COUNT, 1.0), (base + SPEED, counts * dt)]
        elif way or target_mps:
            self.blind = True
        self.rolls_on_s = max(self.rolls_on_s - dt, 0.0)
        faded = math.exp(-dt / SETTLING_S)
        self.unsettled_mps *= faded
        self.restless_mps *= faded
        if self.restless_mps < FADED_MPS:
            self.restless_mps = 0.0

    def _coast(self, step: Step, target_mps: float, *, holds: bool) -> None:
        v, push, dt, new = self.base + SPEED, self.base + PUSH, step.dt, step.new
        speed, kept = new[v], math.exp(-dt / COASTING_S)
        slower = max(abs(speed) * kept - DRY_MPS2 * dt, 0.0)
        step.rows[v], step.rows[push] = [(v, kept if slower else 0.0)], [(push, 0.0)]
        step.noises.append(([(v, 1.0)], (COAST_PART * (abs(speed) - slower)) ** 2))
        if self.cut and target_mps:
            seen = new[self.base + HELD] if holds else math.copysign(speed, speed * target_mps)
            self.wound_m += max(abs(target_mps) - seen, 0.0) * dt
            self.cut = self.wound_m < WINDUP_M
        new[v], new[push] = math.copysign(slower, speed), 0.0

    def _by_duty(self, step: Step, target_mps: float) -> None:
        v, push, new = self.base + SPEED, self.base + PUSH, step.new
        bias = BIAS + self.base // PER_WHEEL
        part = 1 - math.exp(-step.dt / DUTY_S)
        change = part * (target_mps * (1 + new[bias]) - new[v])
        step.rows[v], step.rows[push] = [(v, 1 - part), (bias, part * target_mps)], [(push, 0.0)]
        step.noises.append(([(v, 1.0)], ROUGH * step.dt + (DUTY_PART * change) ** 2))
        new[v], new[push] = new[v] + change, 0.0

    def _controlled(self, step: Step, target_mps: float, *, holds: bool) -> None:
        v, push, dt, new = self.base + SPEED, self.base + PUSH, step.dt, step.new
        sign = math.copysign(1.0, target_mps)
        # The controller uses the last measured speed. The public firmware does not set this speed
        # to zero when the wheel stops. So a wheel at rest may get little power, or none.
        seen, factor = (self.base + HELD, sign) if holds else (v, 1.0)
        lacking = sign * target_mps - sign * factor * new[seen]
        self.locked = holds and not new[v] and lacking + 2 * step.unsure_mps[self.base] <= 0.0
        if self.locked or self.rests:
            new[push] = 0.0
            step.rows[push], step.rows[v] = [(push, 0.0)], [(v, 0.0)]
            return
        if not new[v]:
            lacking = max(lacking, 0.0)
            self.wound_m += lacking * dt
        wound = min(self.wound_m / WINDUP_M, 1.0)
        if wound < 1.0:
            lacking = 0.0
        else:
            self.cut = False
        pull = CONTROL_RATE * CONTROL_RATE * dt
        kept = 1 - 2 * CONTROL_RATE * dt
        new[push] = kept * new[push] + sign * pull * lacking
        new[v] += dt * new[push]
        pulls: Terms = [(seen, -pull * factor)]
        if sign < 0 and wound == 1.0:
            pulls.append((EXCESS + self.base // PER_WHEEL, pull * self.course.target_mps))
        step.rows[push] = [(push, kept), *pulls]
        step.rows[v] = [(v, 1.0), (push, dt * kept), *((state, dt * one) for state, one in pulls)]
        jerk = 4 * CONTROL_RATE * (PUSH_PER_SPEED * self.restless_mps * wound) ** 2
        step.noises.append(([(push, 1.0), (v, dt)], jerk * dt))
        step.noises.append(([(v, 1.0)], ROUGH * dt * wound))
        if new[v] * sign < 0:
            new[v] = new[push] = 0.0
