# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""One wheel: a motor with its encoder, and the firmware's speed controller for it.

Speeds are in encoder counts per tick, efforts in PWM steps. Assumed motor: first order, dry
friction, dead zone. This module must not know commands, geometry or the wire.
"""

from collections import deque
from dataclasses import dataclass
from math import copysign, exp, floor, log

TICK_S = 0.01

PWM_LIMIT = 4095.0
DEAD_ZONE_PWM = 60.0
"""Largest effort that leaves a wheel at rest, in PWM steps."""
STICKING_SPEED = 0.3
"""Speed in counts per tick. A slower wheel stops if its effort is within the dead zone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorConstants:
    """Properties of one motor.

    * ``pwm_per_count``: effort in PWM steps for a speed of one count per tick.
    * ``time_constant_ticks``: time constant of the speed.
    * ``delay_ticks``: delay from an effort to its effect.
    """

    # The manual's feed-forward of 40 is about seven eighths of this value.
    pwm_per_count: float = 46.0
    time_constant_ticks: float = 6.0
    friction_pwm: float = 40.0
    delay_ticks: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelGains:
    """Gains of the wheel's speed controller (manual, Controller parameters)."""

    feed_forward: float = 40.0
    proportional: float = 10.0
    integral: float = 1.5


USUAL = MotorConstants()
MANUAL = WheelGains()


class Motor:
    """A gear motor with its quadrature encoder, simulated in steps of one board tick (10 ms)."""

    def __init__(self, constants: MotorConstants = USUAL) -> None:
        self._constants = constants
        self._decay = exp(-1 / constants.time_constant_ticks)
        self._on_the_way = deque([0.0] * constants.delay_ticks)
        self.speed = 0.0
        self.position = 0.5
        """Position in encoder counts, not rounded. It starts at 0.5, the middle of an encoder
        step."""

    @property
    def encoder(self) -> int:
        """Encoder count that the firmware reads, an integer."""
        return floor(self.position)

    def advance(self, pwm: float, load_pwm: float = 0.0) -> float:
        """Turn for one tick under a constant effort; return the counts turned, not rounded.

        ``load_pwm``: an outside force in PWM steps, which acts without the motor's delay.
        """
        constants, start = self._constants, self.speed
        self._on_the_way.append(pwm)
        pwm = self._on_the_way.popleft() + load_pwm
        if abs(start) < STICKING_SPEED and abs(pwm) <= DEAD_ZONE_PWM:
            self.speed = 0.0
            return 0.0
        direction = start or pwm
        settled = (pwm - copysign(constants.friction_pwm, direction)) / constants.pwm_per_count
        end = settled + (start - settled) * self._decay
        ticks = 1.0
        if end * direction < 0:  # friction stops the wheel within this tick
            ticks = constants.time_constant_ticks * log(1 - start / settled)
            end = 0.0
        turned = settled * ticks + constants.time_constant_ticks * (start - end)
        self.speed = end
        self.position += turned
        return turned

    def turn(self, counts: float, pwm: float) -> None:
        """Let an outside force turn the wheel by ``counts`` in one tick.

        ``pwm``: effort of the motor, which has no effect in this tick.
        """
        self._on_the_way.append(pwm)
        self._on_the_way.popleft()
        self.speed = counts
        self.position += counts


class WheelController:
    """The manual's PI controller (Wheel control). The feed-forward Kff v(k) is not accumulated.

    u(k) = Kff v(k) + w(k),  w(k) = w(k-1) + KVP (e(k) - e(k-1)) + KVI e(k)
    """

    def __init__(self, gains: WheelGains = MANUAL) -> None:
        self._gains = gains
        self._feedback = 0.0
        self._last_error = 0.0

    def update(self, target: float, measured: float) -> float:
        """Return the PWM for the next tick.

        ``target``, ``measured``: commanded and measured speed of the wheel, in counts per tick.
        """
        gains, error = self._gains, target - measured
        self._feedback += gains.proportional * (error - self._last_error)
        self._last_error = error
        effort = gains.feed_forward * target + self._feedback
        # At the limit of the PWM, the integral term may only move the PWM away from the limit.
        if abs(effort) < PWM_LIMIT or effort * error < 0:
            self._feedback += gains.integral * error
            effort += gains.integral * error
        return effort if abs(effort) <= PWM_LIMIT else copysign(PWM_LIMIT, effort)
