# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Finds the gains of the manual's control law that suit a motor, and predicts their effect.

The best gains have the smallest absolute errors after steps of command and load.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from omnibot_driver.tools.calibrate.wheel_loop import (
    MANUAL,
    TICK_S,
    Array,
    Gains,
    Motor,
    answer,
    sensitivity_peak,
)
from omnibot_driver.tools.needs import ToolError

# This limit of the sensitivity's peak tolerates a factor of 2.6 in gain, or 36° in phase.
LARGEST_MS: Final = 1.6
LARGEST_OVERSHOOT: Final = 0.05
HORIZON_TICKS: Final = 400
SETTLED: Final = 1e-3
"""Relative error at the end of the simulation below which a loop is regarded as stable."""
CANDIDATES: Final = 24
"""Number of values of each gain in one round of the search."""
ROUNDS: Final = 3


@dataclass(frozen=True, slots=True)
class Behaviour:
    """The behaviour of a motor with given gains.

    Each value is a number, or an array with one element for each candidate of the gains.

    * ``rise_s``: rise time, from 10 % to 90 % of a step of the command.
    * ``overshoot``: as a fraction of the step.
    * ``command_error_s``: integral of the absolute error after a step of the command by 1.
    * ``load_error_s``: the same after a step of the load by ``Motor.pwm_per_count``.
    * ``ms``: peak of the sensitivity; 1 is best.
    * ``stable``: whether the errors have decayed at the end of the simulation.
    """

    rise_s: Array
    overshoot: Array
    command_error_s: Array
    load_error_s: Array
    ms: Array
    stable: NDArray[np.bool_]


def behaviour(motor: Motor, gains: Gains) -> Behaviour:
    """Simulate a motor with these gains in the manual's control loop; return its behaviour."""
    with np.errstate(over="ignore", invalid="ignore"):
        speed = answer(motor, gains, HORIZON_TICKS)
        feedback = Gains(0.0, gains.proportional, gains.integral)
        loaded = answer(motor, feedback, HORIZON_TICKS, command=0.0, load=motor.pwm_per_count)
        wrong = np.maximum(abs(speed[-1] - 1.0), abs(loaded[-1]))
        rise_ticks = np.argmax(speed >= 0.9, axis=0) - np.argmax(speed >= 0.1, axis=0)
        return Behaviour(
            rise_s=TICK_S * np.asarray(rise_ticks, float),
            overshoot=np.maximum(0.0, speed.max(axis=0) - 1.0),
            command_error_s=abs(speed - 1.0).sum(axis=0) * TICK_S,
            load_error_s=abs(loaded).sum(axis=0) * TICK_S,
            ms=sensitivity_peak(motor, gains),
            stable=wrong < SETTLED,  # false if ``wrong`` is NaN
        )


def better_gains(motors: Sequence[Motor], now: Gains = MANUAL) -> Gains:
    """Return the best gains for all these motors together, within the limits of this module.

    ``now``: the present gains, whose errors are the reference. Raises ToolError if no gains are
    within the limits.
    """
    references = [behaviour(motor, now) for motor in motors]
    need = min(motor.pwm_per_count for motor in motors)
    # K_VP and K_VI are at most ``need``, so an error of one encoder count has little effect.
    forward, proportional, integral = (0.0, 1.0), (0.02, 1.0), (1e-3, 1.0)
    best = Gains(need, 0.02 * need, 1e-3 * need)
    for _ in range(ROUNDS):
        grid = np.meshgrid(
            need * np.linspace(*forward, CANDIDATES),
            need * np.geomspace(*proportional, CANDIDATES),
            need * np.geomspace(*integral, CANDIDATES),
            indexing="ij",
            sparse=True,
        )
        gains = Gains(*grid)
        cost = sum(
            _cost(behaviour(motor, gains), reference)
            for motor, reference in zip(motors, references, strict=True)
        )
        if not np.isfinite(np.min(cost)):
            raise ToolError(
                f"no gains limit the peak of the sensitivity (Ms) to {LARGEST_MS:g} and the"
                f" overshoot to {LARGEST_OVERSHOOT:.0%}; repeat the measurement, with each wheel"
                " off the ground"
            )
        place = np.unravel_index(np.argmin(cost), np.shape(cost))
        best = Gains(*(float(axis.flat[n]) for axis, n in zip(grid, place, strict=True)))
        forward = _around(best.feed_forward / need, 1.0 / CANDIDATES, 0.0, 1.2)
        proportional = _near(proportional, best.proportional / need)
        integral = _near(integral, best.integral / need)
    return best


def _cost(behaves: Behaviour, reference: Behaviour) -> Array:
    """Return the cost of a motor's behaviour relative to the behaviour ``reference``.

    The cost is infinite if the motor is not stable, or exceeds a limit of this module.
    """
    cost = (
        behaves.command_error_s / reference.command_error_s
        + behaves.load_error_s / reference.load_error_s
    )
    allowed = behaves.stable & (behaves.ms <= LARGEST_MS) & (behaves.overshoot <= LARGEST_OVERSHOOT)
    return np.where(allowed, cost, np.inf)


def _around(value: float, reach: float, low: float, high: float) -> tuple[float, float]:
    return max(low, value - reach), min(high, value + reach)


def _near(span: tuple[float, float], value: float) -> tuple[float, float]:
    """Return the range from one grid step below to one above ``value``, clipped to ``span``."""
    factor = (span[1] / span[0]) ** (1.0 / (CANDIDATES - 1))
    return max(span[0], value / factor), min(span[1], value * factor)
