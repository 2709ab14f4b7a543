# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Models of a wheel's step response, as the odometry measures it.

A model gives the wheel's angle after a step, from which the mean rate in a delta of 40 ms follows.
This module does not know measured data.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from omnibot_driver.tools.calibrate.wheel_loop import TICK_S, Array, Gains, Motor, answer

DELTA_TICKS: Final = 4
SPAN_S: Final = DELTA_TICKS * TICK_S
"""Length of an odometry delta, in s.

Source: manual, "25Hz Encoder data"; docs/internals/omnibot_protocol.md.
"""

Turned = Callable[[Array, Array], Array]
"""A function that returns the wheel's angle in rad after its set-point has stepped to 1 rad/s.

Arguments: the model's parameters without the gain, and times after the step in s.
"""


@dataclass(frozen=True, slots=True)
class Model:
    """A model of a step response.

    * ``names``, ``units``: names and units of the parameters. The first parameter is the gain.
    * ``start``, ``low``, ``high``: starting values and bounds of the parameters.
    * ``turned``: the function that returns the wheel's angle after the step (see ``Turned``).
    """

    title: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    start: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    turned: Turned

    def mean(self, parameters: Array, end_s: Array) -> Array:
        """Return the mean rate of each odometry delta after a unit step.

        ``end_s``: times at which the deltas end, in s.
        """
        turned = self.turned(parameters, np.concatenate((end_s, end_s - SPAN_S)))
        return np.asarray((turned[: len(end_s)] - turned[len(end_s) :]) / SPAN_S)


def first_order(parameters: Array, time_s: Array) -> Array:
    """Return the angle turned after a unit step, by the transfer function exp(-L s) / (1 + T s).

    ``parameters``: T and L, in s.
    """
    time_constant_s, delay_s = parameters
    after_s = np.maximum(0.0, time_s - delay_s)
    return np.asarray(after_s + time_constant_s * np.expm1(-after_s / time_constant_s))


def second_order(parameters: Array, time_s: Array) -> Array:
    """Return the angle turned after a unit step, by a transfer function of second order.

    (1 + Z s) exp(-L s) / (1 + 2 ζ s/ω + s²/ω²). ``parameters``: ω in rad/s, ζ, Z and L in s.
    """
    # The zero comes from a PI loop with feed-forward.
    omega, damping, zero_s, delay_s = parameters
    root = np.sqrt(complex(damping * damping - 1.0))
    root = root if abs(root) > 1e-4 else 1e-4  # two close poles replace two equal poles
    poles = omega * (-damping + root), omega * (-damping - root)
    after_s = np.maximum(0.0, time_s - delay_s)
    turned = after_s.astype(complex)
    for pole, other in (poles, poles[::-1]):
        part = (1.0 + zero_s * pole) * other / (pole - other)
        turned += part / pole * np.expm1(pole * after_s)
    return np.asarray(turned.real)


def motor_in_loop(gains: Gains) -> Turned:
    """Return a function that gives the step response of a motor in the manual's control loop.

    The returned function's parameters: PWM steps for one count per tick, time constant and delay
    in s.
    """

    def turned(parameters: Array, time_s: Array) -> Array:
        pwm_per_count, time_constant_s, delay_s = parameters
        motor = Motor(pwm_per_count, time_constant_s / TICK_S, delay_s / TICK_S)
        ticks = max(1, int(np.ceil(time_s.max() / TICK_S)))
        angle = np.concatenate(([0.0], np.cumsum(answer(motor, gains, ticks)))) * TICK_S
        return np.asarray(np.interp(time_s, np.arange(ticks + 1) * TICK_S, angle))

    return turned


FIRST_ORDER: Final = Model(
    "first order with delay",
    ("gain", "time constant", "delay"),
    ("", "s", "s"),
    (1.0, 0.06, 0.01),
    (0.05, 1e-3, 0.0),
    (20.0, 3.0, 0.5),
    first_order,
)
SECOND_ORDER: Final = Model(
    "second order with zero and delay",
    ("gain", "natural frequency", "damping", "zero", "delay"),
    ("", "rad/s", "", "s", "s"),
    (1.0, 15.0, 1.0, 0.03, 0.01),
    (0.05, 0.5, 0.05, -0.2, 0.0),
    (20.0, 400.0, 20.0, 2.0, 0.5),
    second_order,
)


def motor_model(gains: Gains) -> Model:
    """Return the model of a motor in the manual's control loop with the firmware's gains."""
    return Model(
        "motor in the manual's control loop",
        ("gain", "PWM per count", "motor time constant", "motor delay"),
        ("", "PWM/(count/tick)", "s", "s"),
        (1.0, 45.0, 0.06, 0.005),
        (0.05, 3.0, 3e-3, 0.0),
        (20.0, 500.0, 1.0, 0.2),
        motor_in_loop(gains),
    )
