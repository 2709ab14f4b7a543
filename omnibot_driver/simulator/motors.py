"""One wheel: a motor with its encoder, and the firmware's speed controller for it.

Knows the 100 Hz tick and the controller gains of the manual. All speeds are encoder counts per
tick, all efforts PWM steps. Must not know commands, geometry or the wire.

The manual says nothing about the motor. The model is of first order with dry friction and a dead
zone, driven by a 12-bit PWM; a steady speed needs 46 PWM steps per count per tick, so that the
manual's feed-forward of 40 carries seven eighths of the load and the integrator the rest.
"""

from math import copysign, exp, floor, log

TICK_S = 0.01

FEED_FORWARD = 40.0
PROPORTIONAL = 10.0
INTEGRAL = 1.5

PWM_LIMIT = 4095.0
DEAD_ZONE_PWM = 60.0
"""Effort that sets a resting wheel in motion."""
FRICTION_PWM = 40.0
"""Effort that dry friction eats while the wheel turns."""
STICKING_SPEED = 0.3
"""A wheel slower than this is held by the dead zone like a resting one, so it never creeps."""
PWM_PER_COUNT = 46.0
TIME_CONSTANT_TICKS = 6.0

_DECAY = exp(-1 / TIME_CONSTANT_TICKS)


class Motor:
    """A gear motor with its quadrature encoder, moved one tick at a time."""

    def __init__(self) -> None:
        self.speed = 0.0
        self.position = 0.5
        """Counts turned so far with their fraction, from the middle of an encoder step."""

    @property
    def encoder(self) -> int:
        """The whole counts that the firmware can read."""
        return floor(self.position)

    def advance(self, pwm: float) -> float:
        """Turn for one tick under a constant effort; return the counts turned, with fraction."""
        start = self.speed
        if abs(start) < STICKING_SPEED and abs(pwm) <= DEAD_ZONE_PWM:
            self.speed = 0.0
            return 0.0
        direction = start or pwm
        settled = (pwm - copysign(FRICTION_PWM, direction)) / PWM_PER_COUNT
        end = settled + (start - settled) * _DECAY
        ticks = 1.0
        if end * direction < 0:  # friction brings it to rest within this tick
            ticks = TIME_CONSTANT_TICKS * log(1 - start / settled)
            end = 0.0
        turned = settled * ticks + TIME_CONSTANT_TICKS * (start - end)
        self.speed = end
        self.position += turned
        return turned


class WheelController:
    """The PI loop of the manual (Wheel control), its feed-forward outside the accumulator.

    u(k) = Kff v(k) + w(k),  w(k) = w(k-1) + KVP (e(k) - e(k-1)) + KVI e(k)

    While u is saturated, the integral term rests if it would drive u further.
    """

    def __init__(self) -> None:
        self._feedback = 0.0
        self._last_error = 0.0

    def update(self, target: float, measured: float) -> float:
        """Return the PWM for the coming tick from speeds in counts per tick."""
        error = target - measured
        self._feedback += PROPORTIONAL * (error - self._last_error)
        self._last_error = error
        effort = FEED_FORWARD * target + self._feedback
        if abs(effort) < PWM_LIMIT or effort * error < 0:
            self._feedback += INTEGRAL * error
            effort += INTEGRAL * error
        return max(-PWM_LIMIT, min(PWM_LIMIT, effort))
