# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A motor with its wheel and encoder, and the board's speed controller for it.

Speeds are in RPM, efforts in percent of duty. This module does not know commands.
"""

from collections import deque
from dataclasses import dataclass, replace
from math import copysign, exp, floor
from random import Random

from omnibot_driver.simulator.lois_ecu.settings import MotorSettings

LOAD_CHANGES_S = 0.5
NOMINAL_STEP_S = 0.2


class Motor:
    """A motor with its wheel. While ``held`` is true, the wheel does not turn."""

    def __init__(self, settings: MotorSettings, load_percent: float, random: Random) -> None:
        self.rpm = 0.0
        self.held = False
        self._settings = settings
        self._step_s = 0.0
        self._load_percent, self._random = load_percent, random
        self._load = random.gauss(0.0, load_percent)
        self._on_the_way: deque[float] = deque()
        self._lagged_rpm = 0.0
        self._gap = 0.0

    def advance(self, duty_percent: float, dt_s: float) -> float:
        """Advance by ``dt_s``. Return how far the wheel turns in this time, in turns, with sign."""
        if self.held:
            self.rpm = 0.0
            return 0.0
        settings = self._settings
        if dt_s != self._step_s:
            self._prepare(dt_s)
        if settings.dead_time_s:
            duty_percent = self._late(duty_percent)
        if not (duty_percent or self.rpm or self._lagged_rpm):
            return 0.0
        if self._load_percent:
            change = self._random.gauss(0.0, self._load_percent)
            self._load = self._load_kept * self._load + self._load_changed * change
        effort = abs(duty_percent) - settings.dead_zone_percent
        if duty_percent and effort > 0:
            effort = max(effort + self._load, 0.0)
            final = copysign(effort * settings.rpm_per_percent, duty_percent)
        else:
            final = 0.0
        if settings.second_time_constant_s:
            self._lagged_rpm += (final - self._lagged_rpm) * self._second_part
            if not final and abs(self._lagged_rpm) < 1e-3:
                self._lagged_rpm = 0.0
            final = self._lagged_rpm
        before = self.rpm
        self.rpm += (final - before) * self._part
        if not final:
            slower = max(abs(self.rpm) - settings.friction_rpm_per_s * dt_s, 0.0)
            self.rpm = copysign(slower, self.rpm) if slower else 0.0
        turns = (before + self.rpm) / 2 * dt_s / 60
        return self._through_gap(turns) if settings.backlash_turns else turns

    def _prepare(self, dt_s: float) -> None:
        """Calculate the coefficients with which ``advance`` simulates a step of ``dt_s``."""
        settings, self._step_s = self._settings, dt_s
        self._part = 1 - exp(-dt_s / settings.time_constant_s)
        if settings.second_time_constant_s:
            self._second_part = 1 - exp(-dt_s / settings.second_time_constant_s)
        self._load_kept = exp(-dt_s / LOAD_CHANGES_S)
        self._load_changed = (1 - self._load_kept * self._load_kept) ** 0.5
        self._dead_steps = round(settings.dead_time_s / dt_s)

    def _late(self, duty_percent: float) -> float:
        """Return the duty in percent that was commanded one dead time ago."""
        self._on_the_way.append(duty_percent)
        if len(self._on_the_way) <= self._dead_steps:
            return 0.0
        return self._on_the_way.popleft()

    def _through_gap(self, turns: float) -> float:
        """Return how far the wheel turns, in turns, when the motor makes ``turns`` turns.

        The backlash between motor and wheel absorbs the difference.
        """
        gap = self._gap + turns
        self._gap = min(max(gap, 0.0), self._settings.backlash_turns)
        return gap - self._gap


class Encoder:
    """An encoder disc, on which short and long levels alternate.

    A period is one level of each length.

    * ``steps``: edges per turn.
    * ``short``: length of the short level, as a fraction of a period.
    * ``noise``: standard deviation of a level's length, as a fraction of half a period.
    """

    def __init__(self, steps: int, short: float, *, noise: float, random: Random) -> None:
        self._periods = 0.0
        self._level_from = self._level_to = 0.0
        """``_level_from``, ``_level_to``: positions of the nearest edges before and after the
        sensor, in periods of the disc."""
        self._per_turn = steps / 2
        self._short = short
        # The distance between two marks has the position errors of both marks. So the error of each
        # mark is smaller by the square root of 2.
        self._off = [
            noise / 2 / 2**0.5 * random.gauss(0.0, 1.0) for _ in range(steps if noise else 1)
        ]

    def turn(self, turns: float) -> list[tuple[float, bool, int]]:
        """Turn the disc. Return the edges that passed the sensor, in order.

        An edge has a time, as a fraction of the step; whether a long level ended; and a direction,
        1 forward or -1 backward.
        """
        before = self._periods
        after = self._periods = before + turns * self._per_turn
        begin, end = self._level_from, self._level_to
        if begin <= before < end and begin <= after < end:
            return []
        level_before, level_after = self._level(before), self._level(after)
        self._level_from, self._level_to = self._place(level_after), self._place(level_after + 1)
        forward = after > before
        if forward:
            edges = range(level_before + 1, level_after + 1)
        else:
            edges = range(level_before, level_after, -1)
        return [
            (
                (self._place(edge) - before) / (after - before),
                (edge % 2 == 0) is forward,
                1 if forward else -1,
            )
            for edge in edges
        ]

    def _place(self, edge: int) -> float:
        """Return the position of edge number ``edge``, in periods of the disc."""
        return edge // 2 + (self._short if edge % 2 else 0.0) + self._off[edge % len(self._off)]

    def _level(self, periods: float) -> int:
        level = 2 * floor(periods) - 1
        while periods >= self._place(level + 1):
            level += 1
        return level


@dataclass(frozen=True, slots=True)
class Gains:
    """Gains of the manual's speed controller.

    * ``feed_forward``: in percent of duty per RPM.
    * ``low_pass``: 0..1. In each step, the controller's own target moves towards the commanded
      target by this fraction of the distance between them.
    """

    kp: float
    tn: float
    td: float
    feed_forward: float = 0.0
    low_pass: float = 1.0


class SpeedController:
    """The board's speed controller, from measured and target RPM to a duty in percent.

    G(s) = Kp (1 + s Tn) / (s Tn (1 + s Td)), discretised by the trapezoidal rule for steps of
    ``NOMINAL_STEP_S``, even if the true steps differ.
    """

    def __init__(self, gains: Gains) -> None:
        self.gains = gains
        self.restart()

    def change(self, **gains: float) -> None:
        """Change the named gains and restart the controller."""
        self.gains = replace(self.gains, **gains)
        self.restart()

    def restart(self) -> None:
        """Reset the controller's state. The gains remain."""
        self._errors = self._outputs = (0.0, 0.0)
        self._target = 0.0

    def step(self, measured_rpm: float, target_rpm: float) -> float:
        """Return the duty in percent, -100..100. It is zero if the target is zero."""
        if not target_rpm:
            self.restart()
            return 0.0
        gains = self.gains
        self._target += gains.low_pass * (target_rpm - self._target)
        half_s, tn, td = NOMINAL_STEP_S / 2, max(gains.tn, 1e-3), gains.td
        error = self._target - measured_rpm
        weighed = (tn + half_s) * error + 2 * half_s * self._errors[0]
        weighed -= (tn - half_s) * self._errors[1]
        kept = 2 * td * self._outputs[0] - (td - half_s) * self._outputs[1]
        output = (gains.kp * half_s / tn * weighed + kept) / (td + half_s)
        # An output beyond 100 % does not enter the state (anti-windup).
        if abs(output) < 100.0:
            self._outputs = (output, self._outputs[0])
        self._errors = (error, self._errors[0])
        if output * self._target < 0:
            output = 0.0
        return max(-100.0, min(100.0, output + gains.feed_forward * self._target))
