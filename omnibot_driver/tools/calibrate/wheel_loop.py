# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The simulation of one wheel in the manual's control loop, for small changes of speed.

Units: ticks of 10 ms, encoder counts per tick, PWM steps. A wheel must not change its direction,
because the dry friction is assumed to be constant.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TICK_S: Final = 0.01
"""Control period of a wheel, in s. Source: manual, "Wheel control: 100Hz loop"."""


@dataclass(frozen=True, slots=True)
class Motor:
    """A motor of first order.

    ``pwm_per_count``: effort in PWM steps for a speed of one count per tick.

    ``time_constant_ticks``, ``delay_ticks``: time constant and dead time, in ticks.
    """

    pwm_per_count: float
    time_constant_ticks: float
    delay_ticks: float


@dataclass(frozen=True, slots=True)
class Gains:
    """The gains K_ff, K_VP and K_VI: numbers, or arrays of the same shape with many candidates."""

    feed_forward: Any
    proportional: Any
    integral: Any


MANUAL: Final = Gains(40.0, 10.0, 1.5)
"""The gains of the manual, "Controller parameters"."""


def answer(
    motor: Motor, gains: Gains, ticks: int, *, command: float = 1.0, load: float = 0.0
) -> Array:
    """Return the speed of a simulated wheel during each tick, with the manual's control law.

    ``ticks``: duration. ``command``, ``load``: speed in counts per tick and load in PWM steps, both
    from the first tick on.
    """
    forward, proportional, integral = gains.feed_forward, gains.proportional, gains.integral
    shape = np.broadcast(forward, proportional, integral).shape
    zero: Any = np.zeros(shape)
    if not shape:  # numpy is slow with single numbers
        zero, forward, proportional, integral = map(float, (zero, forward, proportional, integral))
    effort_per_speed, lag = float(motor.pwm_per_count), float(motor.time_constant_ticks)
    load, (whole, part) = float(load), divmod(float(motor.delay_ticks), 1.0)
    # ``settled``: the speeds to which the efforts would bring the wheel. ``shares``: an effort can
    # begin to act within a tick, so two efforts act in each tick, each for one of these shares.
    settled = [(zero - load) / effort_per_speed] * (int(whole) + 1)
    shares = [(share, float(np.exp(-share / lag))) for share in (part, 1.0 - part)]
    speeds = np.zeros((ticks, *shape))
    momentary = turned = feedback = before = zero
    for tick in range(ticks):
        error = command - turned
        # u(k) = K_ff v + w(k), w(k) = w(k-1) + K_VP (e(k) - e(k-1)) + K_VI e(k). An effort acts
        # from the next tick on, and later by ``delay_ticks``.
        feedback = feedback + proportional * (error - before) + integral * error
        before = error
        settled.append((forward * command + feedback - load) / effort_per_speed)
        turned = zero
        for number, (share, decay) in enumerate(shares, tick):
            comes_to = settled[number]
            after = comes_to + (momentary - comes_to) * decay
            turned = turned + comes_to * share + lag * (momentary - after)
            momentary = after
        speeds[tick] = turned
    return speeds


def sensitivity_peak(motor: Motor, gains: Gains, points: int = 400) -> Array:
    """Return Ms, the largest amplification of a disturbance by a stable loop; 1 is best.

    Ms is the reciprocal of the smallest distance between the loop's Nyquist curve and -1.
    """
    frequency = np.geomspace(1e-3, np.pi, points)
    z = np.exp(1j * frequency)
    plant = _plant(motor, z)
    shape = np.broadcast(gains.proportional, gains.integral).shape
    along = (points, *(1,) * len(shape))
    integrator = (1.0 / (1.0 - 1.0 / z)).reshape(along)
    loop = plant.reshape(along) * (gains.proportional + gains.integral * integrator)
    return np.asarray(np.max(1.0 / np.abs(1.0 + loop), axis=0))


def _plant(motor: Motor, z: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the transfer function from effort to counts, at points z of the unit circle."""
    whole, part = divmod(motor.delay_ticks, 1.0)
    lag = motor.time_constant_ticks
    decay = np.exp(-1.0 / lag)

    def way(share: float) -> float:
        """Return how many counts the wheel turns in ``share`` ticks if it starts from rest.

        ``share``: 0 to 3, not necessarily whole. The constant effort gives a final speed of one
        count per tick.
        """
        return float(share - lag * (1.0 - np.exp(-share / lag)))

    risen = [way(1.0 - part), way(2.0 - part) - way(1.0 - part), way(3.0 - part) - way(2.0 - part)]
    pulse = [risen[0], risen[1] - risen[0], risen[2] - risen[1]]
    tail = pulse[2] / z**3 / (1.0 - decay / z)
    response = (pulse[0] / z + pulse[1] / z**2 + tail) / z ** int(whole)
    return np.asarray(response / motor.pwm_per_count)
