# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The simulation of a wheel with a band-limited PI controller, after a step of the set-point.

This module does not know how plant and gains were found.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from omnibot_driver.tools.calibrate.tick_fit import Plant

Array = NDArray[np.float64]

STEP_S: Final = 0.001
NOMINAL_S: Final = 0.2
"""Control period of the manual, in s. The board computes its coefficients for this period."""
STALE_S: Final = 0.5
SENDS_S: Final = 9 * 14 * 10 / 115200
"""Time, in s, in which the public firmware sends tick counts and odometry: nine lines of 14
characters."""
MOST_PERCENT: Final = 100.0
PHASE_POINTS: Final = 600


@dataclass(frozen=True, slots=True)
class PiGains:
    """The gains Kp, Tn and Td that are written to the board. Tn and Td are in s.

    The gains are numbers, or arrays of the same shape with many candidates.
    """

    kp: Array | float
    tn_s: Array | float
    td_s: Array | float


@dataclass(frozen=True, slots=True)
class Loop:
    """The control loop of a wheel. Times are in s.

    * ``dead_s``: dead time of the plant.
    * ``whole_rpm``: whether the measured speed is rounded down to whole RPM.
    * ``nominal_s``: the control period that the board assumes.
    * ``feed_forward``: duty in percent for each RPM of the set-point.
    * ``low_pass``: coefficient of the set-point's low-pass filter; 1: no filter.
    * ``sends_each_s``: period with which the board sends its tick counts.
    """

    period_s: float
    ticks_per_revolution: int
    dead_s: float = 0.0
    whole_rpm: bool = True
    nominal_s: float = NOMINAL_S
    feed_forward: float = 0.0
    low_pass: float = 1.0
    sends_each_s: float = 0.2

    @property
    def stretch(self) -> float:
        """Factor by which a time constant is multiplied before it is written to the board.

        The board computes its coefficients for the control period ``nominal_s``. Its real control
        period is ``period_s``.
        """
        return self.nominal_s / self.period_s


def answer(
    plant: Plant,
    gains: PiGains,
    loop: Loop,
    target_rpm: float,
    seconds: float,
    *,
    dead_s: Array | None = None,
    begun: Array | float = 0.0,
    sent_s: Array | None = None,
) -> Array:
    """Return the speed of a wheel, in RPM, after a step of the set-point from standstill.

    The first dimension of the result is time, in steps of 1 ms. The other dimensions are the common
    shape of the gains and the arguments below.

    * ``dead_s``: dead time in s; None: that of ``loop``.
    * ``begun``: initial position of the wheel between two encoder ticks, 0 to 1.
    * ``sent_s``: time in s at which the board first sends its tick counts; None: never.
    """
    late, calm = loop.dead_s if dead_s is None else dead_s, sent_s is None
    every = np.broadcast_arrays(
        *(
            np.asarray(one, dtype=np.float64)
            for one in (gains.kp, gains.tn_s, gains.td_s, late, begun, 0.0 if calm else sent_s)
        )
    )
    shape = every[0].shape
    kp, tn_s, td_s, late_s, ticks, sends_s = (one.ravel() for one in every)
    count, period = round(seconds / STEP_S), round(loop.period_s / STEP_S)
    dead = np.rint(late_s / STEP_S).astype(int)
    groups = [(int(one), np.flatnonzero(dead == one)) for one in np.unique(dead)]
    finals: list[Array] = []
    final = np.zeros(len(kp))
    told = np.zeros((count, len(kp)))
    first = 1 - np.exp(-STEP_S / max(plant.slow_s, STEP_S))
    second = 1 - np.exp(-STEP_S / plant.fast_s) if plant.fast_s > STEP_S else 1.0
    lagged, rpm, ticked_s = (np.zeros(len(kp)) for _ in range(3))
    seen, wished = np.zeros(len(kp)), np.zeros(len(kp))
    whole = np.floor(ticks)
    errors, outputs = [np.zeros(len(kp))] * 2, [np.zeros(len(kp))] * 2
    per_rpm, half_s = loop.ticks_per_revolution / 60, loop.nominal_s / 2
    tn_s = np.maximum(tn_s, 1e-3)
    # The controller is G(s) = Kp (1 + s Tn) / (s Tn (1 + s Td)), from the error in RPM to the duty
    # in percent, discretised by the trapezoidal rule. The board takes ``nominal_s`` as its control
    # period, even if the real one differs. ``seen``: RPM by the time between the last two ticks.
    # ``finals``: the RPM to which the duty of each control period would bring the wheel.
    for step in range(count):
        now_s = step * STEP_S
        if step % period == 0:
            seen = np.where(now_s - ticked_s > STALE_S, 0.0, seen)
            wished = wished + loop.low_pass * (target_rpm - wished)
            error = wished - (np.floor(seen) if loop.whole_rpm else seen)
            weighed = (tn_s + half_s) * error + 2 * half_s * errors[0] - (tn_s - half_s) * errors[1]
            kept = 2 * td_s * outputs[0] - (td_s - half_s) * outputs[1]
            output = (kp * half_s / tn_s * weighed + kept) / (td_s + half_s)
            free = np.abs(output) < MOST_PERCENT
            outputs = [
                np.where(free, new, old)
                for new, old in zip((output, outputs[0]), outputs, strict=True)
            ]
            errors = [error, errors[0]]
            power = np.where(output * wished < 0, 0.0, output) + loop.feed_forward * wished
            duty = np.floor(np.clip(power, 0.0, MOST_PERCENT))
            finals.append(plant.rpm_per_percent * np.maximum(duty - plant.dead_zone_percent, 0.0))
        for delay, lanes in groups:
            if step >= delay and (step - delay) % period == 0:
                final[lanes] = finals[(step - delay) // period][lanes]
        lagged = lagged + (final - lagged) * second
        rpm = rpm + (lagged - rpm) * first
        told[step] = rpm
        ticks = ticks + rpm * per_rpm * STEP_S
        before, whole = whole, np.floor(ticks)
        passed = np.flatnonzero(whole > before)
        if not len(passed):
            continue
        rate = np.maximum(rpm[passed] * per_rpm, 1e-9)
        at_s = now_s + STEP_S - (ticks[passed] - whole[passed]) / rate
        # While the board sends, it notices a tick only at the end of the sending. The measured
        # speed is too low at this tick, and too high at the next tick.
        if not calm:
            since_s = (at_s - sends_s[passed]) % loop.sends_each_s
            at_s = at_s + np.maximum(SENDS_S - since_s, 0.0)
        seen[passed] = 1.0 / (per_rpm * np.maximum(at_s - ticked_s[passed], 1e-6))
        ticked_s[passed] = at_s
    return told.reshape((count, *shape))


@dataclass(frozen=True, slots=True)
class Traits:
    """Characteristics of a step response, as numbers or arrays.

    * ``overshoot``: as a fraction of the final speed or of the target, whichever is higher.
    * ``settled_s``: settling time, in s; infinite if the speed does not stay at the target.
    * ``error_s``: integral of the absolute error divided by the target, in s.
    """

    overshoot: Array
    settled_s: Array
    error_s: Array


def traits(rpm: Array, target_rpm: float, band: float) -> Traits:
    """Return the characteristics of a step response to the set-point ``target_rpm``.

    * ``rpm``: the speed every 1 ms.
    * ``band``: allowed deviation from the final speed (mean of the last quarter), as a fraction.
    """
    comes_to = _final_rpm(rpm)
    outside = np.abs(rpm - comes_to) > band * np.maximum(comes_to, 1e-9)
    last = len(rpm) - 1 - np.argmax(outside[::-1], axis=0)
    settled = np.where(outside.any(axis=0), (last + 1) * STEP_S, 0.0)
    wrong = np.abs(comes_to - target_rpm) > max(1.5, 0.05 * target_rpm)
    settled = np.where(outside[-1] | wrong, np.inf, settled)
    error = np.abs(rpm - target_rpm).sum(axis=0) * STEP_S / target_rpm
    return Traits(overshoot(rpm, target_rpm), np.asarray(settled), np.asarray(error))


def overshoot(rpm: Array, target_rpm: float) -> Array:
    """Return the overshoot of a step response to the set-point ``target_rpm``.

    The result is a fraction of the final speed or of ``target_rpm``, whichever is higher. ``rpm``:
    the speed every 1 ms.
    """
    reference = np.maximum(_final_rpm(rpm), target_rpm)
    return np.asarray(np.maximum(rpm.max(axis=0) / reference - 1.0, 0.0))


def _final_rpm(rpm: Array) -> Array:
    return np.asarray(rpm[-len(rpm) // 4 :].mean(axis=0))


def phase_margin_deg(plant: Plant, gains: PiGains, loop: Loop, rpm: float) -> Array:
    """Return the phase margin, in degrees: 180 plus the open loop's phase where its gain is 1."""
    kp, tn_s, td_s = np.broadcast_arrays(
        *(
            np.asarray(gain, dtype=np.float64)[..., None]
            for gain in (gains.kp, gains.tn_s, gains.td_s)
        )
    )
    omega = np.geomspace(1e-2, 0.999 * np.pi / loop.period_s, PHASE_POINTS)
    # The delay: the dead time, half a control period until a duty acts, and one tick. The measured
    # speed is a mean over one tick, and on average half a tick old.
    late_s = loop.dead_s + loop.period_s / 2 + 60.0 / (rpm * loop.ticks_per_revolution)
    sampled = 2j * np.tan(omega * loop.period_s / 2) / loop.nominal_s
    controller = kp * (1 + sampled * tn_s) / (sampled * tn_s * (1 + sampled * td_s))
    s = 1j * omega
    open_loop = controller * plant.rpm_per_percent
    open_loop = open_loop / ((1 + s * plant.slow_s) * (1 + s * plant.fast_s))
    phase = np.unwrap(np.angle(open_loop), axis=-1) - omega * late_s
    above = np.abs(open_loop) >= 1.0
    place = np.where(above.any(axis=-1), PHASE_POINTS - 1 - np.argmax(above[..., ::-1], axis=-1), 0)
    found = np.take_along_axis(phase, place[..., None], axis=-1)[..., 0]
    return np.asarray(180.0 + np.degrees(found))
