# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Prediction of the board's own odometry (0x20).

The firmware computes its odometry from the wheel speeds at the last tick of each wheel.
"""

import math
from typing import TYPE_CHECKING, Final

from omnibot_driver.core.lois_ecu.wheel_motion import (
    ALONG,
    BIAS,
    HELD,
    SPEED,
    STANDS_MPS,
    TURN,
    Step,
    Terms,
)

if TYPE_CHECKING:
    from omnibot_driver.core.lois_ecu.motion_filter import MotionFilter

START_TICKS: Final = 0.5
START_STDDEV_TICKS: Final = 0.9
"""``START_TICKS``, ``START_STDDEV_TICKS``: mean and standard deviation, in ticks, of the motion
that the board's odometry (0x20) misses each time a wheel starts."""
FAST_TICKS_PER_S: Final = 50.0
LOST_TICKS: Final = 3.0
"""Growth of the error variance of the board's odometry (0x20), in squared ticks per s.

The variance grows while a wheel is faster than ``FAST_TICKS_PER_S``, because the board then misses
ticks.
"""


def measure_speeds(motion: "MotionFilter", step: Step, before: tuple[float, float]) -> None:
    """Predict what the board measures in a step: the speeds of the wheels, and its odometry (0x20).

    The prediction is stored in ``step``. ``before``: speeds of the left and right wheel before the
    step, in m/s.
    """
    dt, new = step.dt, step.new
    turn: Terms = [(TURN, 1.0)]
    along: Terms = [(ALONG, 1.0)]
    told = [0.0, 0.0]
    for index, wheel in enumerate(motion.wheels):
        base, sign, speed = wheel.base, wheel.course.measured_sign, abs(before[index])
        if not sign:
            continue
        side, forward = 2 * index - 1, math.copysign(1.0, before[index])
        if speed < STANDS_MPS <= abs(new[base + SPEED]):
            lost = sign * START_TICKS * motion.tick_m
            new[TURN] -= side * lost
            new[ALONG] -= lost / 2
            spread = START_STDDEV_TICKS * motion.tick_m
            step.noises.append(([(TURN, side), (ALONG, 0.5)], spread**2))
        # The board notices ticks late while it sends, so 0x20 misses a part of the motion.
        if speed > FAST_TICKS_PER_S * motion.tick_m:
            variance = LOST_TICKS * motion.tick_m**2 * dt
            step.noises.append(([(TURN, side), (ALONG, 0.5)], variance))
        # At each tick of either wheel, 0x20 uses the last measured speeds of both. So while one
        # wheel rests, its old speed is used.
        fresh = speed / max(abs(before[0]) + abs(before[1]), STANDS_MPS)
        shown = fresh * speed + (1 - fresh) * new[base + HELD] - motion.rounded_mps(index)
        if shown > 0.0:
            told[index] = sign * shown
            for terms, factor in ((turn, side * sign * dt), (along, sign * dt / 2)):
                terms.append((base + SPEED, factor * fresh * forward))
                terms.append((base + HELD, factor * (1 - fresh)))
                if wheel.course.kind == "rpm":
                    terms.append((BIAS + index, -factor))
        renewed = 1 - math.exp(-speed * dt / motion.tick_m)
        step.rows[base + HELD] = [(base + HELD, 1 - renewed), (base + SPEED, forward * renewed)]
        new[base + HELD] += renewed * (speed - new[base + HELD])
    new[TURN] += (told[1] - told[0]) * dt
    new[ALONG] += (told[1] + told[0]) / 2 * dt
    step.rows[TURN], step.rows[ALONG] = turn, along
    motion.differing_mps = min(motion.differing_mps, abs(told[1] - told[0]))
