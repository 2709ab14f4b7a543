# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The simulation of one wheel in the manual's control loop, for small changes of speed.

A tick is the control period of 10 ms. Speeds are in encoder counts per tick, efforts in PWM steps,
times in ticks. The wheel must not change its direction, because the dry friction is assumed to be
constant. This module knows the motor and the control law; it does not know measurements or radians.
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


@dataclass(frozen=True, slots=True)
class Answer:
    """The response of a wheel, with one value for each tick since the new command.

    ``speed``: speed during the tick. ``effort``: effort that was computed in the tick.
    """

    speed: Array
    effort: Array


def answer(
    motor: Motor, gains: Gains, ticks: int, *, command: float = 1.0, load: float = 0.0
) -> Answer:
    """Simulate a wheel with the manual's control law; return its response in each tick.

    The commanded speed and the load change from 0 to ``command`` and ``load`` at the same time.

    ``ticks``: duration of the simulation. ``command``: in counts per tick.

    ``load``: effort that the load needs, in PWM steps.
    """
    shape = np.broadcast(gains.feed_forward, gains.proportional, gains.integral).shape
    whole, part = divmod(motor.delay_ticks, 1.0)
    efforts = np.zeros((ticks + int(whole) + 1, *shape))
    speeds = np.zeros((ticks, *shape))
    momentary, turned = np.zeros(shape), np.zeros(shape)
    feedback, before = np.zeros(shape), np.zeros(shape)
    for tick in range(ticks):
        error = command - turned
        # u(k) = K_ff v + w(k), w(k) = w(k-1) + K_VP (e(k) - e(k-1)) + K_VI e(k). An effort acts
        # from the next tick on, and later by ``delay_ticks``.
        feedback = feedback + gains.proportional * (error - before) + gains.integral * error
        before = error
        late = tick + int(whole) + 1
        efforts[late] = gains.feed_forward * command + feedback
        turned = np.zeros(shape)
        for effort, share in ((efforts[tick], part), (efforts[tick + 1], 1.0 - part)):
            settled = (effort - load) / motor.pwm_per_count
            decay = np.exp(-share / motor.time_constant_ticks)
            after = settled + (momentary - settled) * decay
            turned = turned + settled * share + motor.time_constant_ticks * (momentary - after)
            momentary = after
        speeds[tick] = turned
    return Answer(speeds, efforts[int(whole) + 1 :])


def sensitivity_peak(motor: Motor, gains: Gains, points: int = 400) -> Array:
    """Return Ms: 1 / the smallest distance of the loop's Nyquist curve from -1.

    Ms is a stable loop's largest amplification of a disturbance; 1 is best.
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
        """Return how many counts the wheel turns from rest in ``share`` ticks.

        The effort is the one that leads to a final speed of one count per tick.
        """
        return float(share - lag * (1.0 - np.exp(-share / lag)))

    risen = [way(1.0 - part), way(2.0 - part) - way(1.0 - part), way(3.0 - part) - way(2.0 - part)]
    pulse = [risen[0], risen[1] - risen[0], risen[2] - risen[1]]
    tail = pulse[2] / z**3 / (1.0 - decay / z)
    response = (pulse[0] / z + pulse[1] / z**2 + tail) / z ** int(whole)
    return np.asarray(response / motor.pwm_per_count)
