# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A wheel under a sampled band-limited PI controller, as a step of its set-point shows it.

G(s) = Kp (1 + s Tn) / (s Tn (1 + s Td)) from error in RPM to duty in percent, worked out once
in each control period. The speed is that of the last tick of the encoder, in whole RPM. Vectorised
over gains. Knows a plant and gains; it does not know how either was found.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from omnibot_driver.tools.calibrate.tick_fit import Plant

Array = NDArray[np.float64]

STEP_S: Final = 0.001
STALE_S: Final = 0.5
MOST_PERCENT: Final = 100.0
PHASE_POINTS: Final = 600


@dataclass(frozen=True, slots=True)
class PiGains:
    """Gains of a PI controller: scalars, or arrays of the same shape."""

    kp: Array | float
    tn_s: Array | float
    td_s: Array | float


@dataclass(frozen=True, slots=True)
class Loop:
    """The control loop of a wheel. ``dead_s``: time until a duty shows in the speed."""

    period_s: float
    ticks_per_revolution: int
    dead_s: float = 0.0
    whole_rpm: bool = True


def answer(plant: Plant, gains: PiGains, loop: Loop, target_rpm: float, seconds: float) -> Array:
    """Speed in RPM from standstill, (samples of STEP_S, *shape of the gains)."""
    kp, tn_s, td_s = np.broadcast_arrays(
        *(np.asarray(gain, dtype=np.float64) for gain in (gains.kp, gains.tn_s, gains.td_s))
    )
    shape = kp.shape
    count, period = round(seconds / STEP_S), round(loop.period_s / STEP_S)
    dead = round(loop.dead_s / STEP_S)
    duties = np.zeros((count + dead + 1, *shape))
    told = np.zeros((count, *shape))
    first = 1 - np.exp(-STEP_S / max(plant.slow_s, STEP_S))
    second = 1 - np.exp(-STEP_S / plant.fast_s) if plant.fast_s > STEP_S else 1.0
    lagged, rpm, ticks, ticked_s = (np.zeros(shape) for _ in range(4))
    seen, summed, output, duty = (np.zeros(shape) for _ in range(4))
    per_rpm = loop.ticks_per_revolution / 60
    gain, lag = loop.period_s / np.maximum(tn_s, 1e-3), loop.period_s / (td_s + loop.period_s)
    for step in range(count):
        now_s = step * STEP_S
        if step % period == 0:
            seen = np.where(now_s - ticked_s > STALE_S, 0.0, seen)
            error = target_rpm - (np.floor(seen) if loop.whole_rpm else seen)
            wanted = kp * (error + summed + error * gain)
            output = output + (wanted - output) * lag
            free = (np.abs(output) < MOST_PERCENT) | (output * error < 0)
            summed = np.where(free, summed + error * gain, summed)
            output = np.clip(output, -MOST_PERCENT, MOST_PERCENT)
            duty = np.floor(np.maximum(output, 0.0))
        duties[step + dead] = duty
        final = plant.rpm_per_percent * np.maximum(duties[step] - plant.dead_zone_percent, 0.0)
        lagged = lagged + (final - lagged) * second
        rpm = rpm + (lagged - rpm) * first
        told[step] = rpm
        before, ticks = ticks, ticks + rpm * per_rpm * STEP_S
        passed = np.floor(ticks) > np.floor(before)
        rate = np.maximum(rpm * per_rpm, 1e-9)
        at_s = now_s + STEP_S - (ticks - np.floor(ticks)) / rate
        seen = np.where(passed, 1.0 / (per_rpm * np.maximum(at_s - ticked_s, 1e-6)), seen)
        ticked_s = np.where(passed, at_s, ticked_s)
    return told


@dataclass(frozen=True, slots=True)
class Traits:
    """Of a step.

    ``overshoot``: in parts of the speed that it comes to, or is to; ``settled_s``: when it is in
    the tolerance band for good, infinite where it is not; ``error_s``: integral of the absolute
    error, in parts of the target. Scalars or arrays.
    """

    overshoot: Array
    settled_s: Array
    error_s: Array


def traits(rpm: Array, target_rpm: float, band: float) -> Traits:
    """Traits of an answer; its final speed is the mean of its last quarter."""
    comes_to = rpm[-len(rpm) // 4 :].mean(axis=0)
    overshoot = np.maximum(rpm.max(axis=0) / np.maximum(comes_to, target_rpm) - 1.0, 0.0)
    outside = np.abs(rpm - comes_to) > band * np.maximum(comes_to, 1e-9)
    last = len(rpm) - 1 - np.argmax(outside[::-1], axis=0)
    settled = np.where(outside.any(axis=0), (last + 1) * STEP_S, 0.0)
    wrong = np.abs(comes_to - target_rpm) > max(1.5, 0.05 * target_rpm)
    settled = np.where(outside[-1] | wrong, np.inf, settled)
    error = np.abs(rpm - target_rpm).sum(axis=0) * STEP_S / target_rpm
    return Traits(np.asarray(overshoot), np.asarray(settled), np.asarray(error))


def phase_margin_deg(plant: Plant, gains: PiGains, loop: Loop, rpm: float) -> Array:
    """Phase margin of the open loop: distance from -180 degrees where its gain is 1.

    Half a control period passes until an order counts, and half a tick until a speed is seen.
    """
    kp, tn_s, td_s = np.broadcast_arrays(
        *(
            np.asarray(gain, dtype=np.float64)[..., None]
            for gain in (gains.kp, gains.tn_s, gains.td_s)
        )
    )
    omega = np.geomspace(1e-2, np.pi / loop.period_s, PHASE_POINTS)
    s = 1j * omega
    late_s = loop.dead_s + loop.period_s / 2 + 30.0 / (rpm * loop.ticks_per_revolution)
    open_loop = (kp * (1 + s * tn_s) / (s * tn_s * (1 + s * td_s)) * plant.rpm_per_percent) / (
        (1 + s * plant.slow_s) * (1 + s * plant.fast_s)
    )
    phase = np.unwrap(np.angle(open_loop), axis=-1) - omega * late_s
    above = np.abs(open_loop) >= 1.0
    place = np.where(above.any(axis=-1), PHASE_POINTS - 1 - np.argmax(above[..., ::-1], axis=-1), 0)
    found = np.take_along_axis(phase, place[..., None], axis=-1)[..., 0]
    return np.asarray(180.0 + np.degrees(found))
