# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The result of ``calibrate step``, for the table, the file and the user."""

from typing import Any, Final

from omnibot_driver.tools.calibrate.result import Finding, Result
from omnibot_driver.tools.calibrate.step_figure import draw
from omnibot_driver.tools.calibrate.step_fit import Fit, WheelFound
from omnibot_driver.tools.calibrate.tuning import Behaviour, behaviour, better_gains
from omnibot_driver.tools.calibrate.wheel_loop import Gains

UNLIKE_ONE: Final = 0.02
"""Difference of a wheel's gain from 1 above which the tool recommends ``calibrate scale``."""
QUANTUM_RADPS: Final = 0.05
"""Standard deviation, in rad/s, of the rate of an odometry delta, due to quantisation by the
encoder and the protocol's unit of 0.1 mm."""
MANY: Final = 1.5
"""Ratio of the residuals to the quantisation error above which the tool warns. A busy computer that
delays commands, for example, doubles the residuals."""
UNEXPLAINED: Final = 1.2
"""Residual of the motor model, divided by the residual of the second-order model, above which the
motor model is regarded as wrong."""


def result_of(found: list[WheelFound], now: Gains) -> Result:
    """Find better gains, and return the result.

    ``now``: the gains in the firmware. All wheels have the same gains.
    """
    motors = [wheel.motor for wheel in found]
    better = better_gains(motors, now)
    findings = [row for wheel in found for row in _rows(wheel)]
    findings += [
        Finding(name=name, value=round(value, 1), unit=unit, before=before)
        for name, unit, value, before in (
            ("better K_ff", "PWM/(count/tick)", better.feed_forward, now.feed_forward),
            ("better K_VP", "PWM/(count/tick)", better.proportional, now.proportional),
            ("better K_VI", "PWM/count", better.integral, now.integral),
        )
    ]
    record = {
        "step": {
            "wheels": {wheel.name: _recorded(wheel) for wheel in found},
            "gains": [now.feed_forward, now.proportional, now.integral],
            "better_gains": [
                round(gain, 2)
                for gain in (better.feed_forward, better.proportional, better.integral)
            ],
        }
    }
    notes = [sentence for wheel in found for sentence in _remarks(wheel)]
    notes += [
        f"With the current gains, {_told([behaviour(motor, now) for motor in motors])}.",
        f"With the better gains, {_told([behaviour(motor, better) for motor in motors])}.",
        "The driver cannot set the gains, because they are constants in the firmware.",
    ]
    return Result(
        findings=findings,
        parameters={},
        record=record,
        notes=notes,
        draw=lambda figure: draw(figure, found, now, better),
    )


def _rows(wheel: WheelFound) -> list[Finding]:
    answer, motor = wheel.answer, wheel.motor_fit
    rows = [
        Finding(name=f"{wheel.name}: {what}", value=value, sigma=sigma, unit=unit)
        for what, value, sigma, unit in [
            *_of(answer, "gain"),
            *((f"{name}", *figures, unit) for (name, figures), unit in _traits(answer)),
            *((f"first order, {row[0]}", *row[1:]) for row in _of(wheel.first)[1:]),
            *((f"second order, {row[0]}", *row[1:]) for row in _of(wheel.second)[1:]),
            *_of(motor)[1:],
        ]
    ]
    return rows


def _of(fit: Fit, *names: str) -> list[tuple[str, float, float, str]]:
    rows = zip(fit.model.names, fit.values, fit.sigmas, fit.model.units, strict=True)
    return [
        (name, float(value), float(sigma), unit)
        for name, value, sigma, unit in rows
        if not names or name in names
    ]


def _traits(fit: Fit) -> Any:
    return zip(fit.traits().items(), ("s", ""), strict=True)


def _recorded(wheel: WheelFound) -> dict[str, Any]:
    return {
        fit.model.title: {
            "residual_radps": round(fit.rms_radps, 4),
            "aic": round(fit.aic, 1),
            **{name: [float(f"{v:.5g}"), float(f"{s:.2g}")] for name, v, s, _ in _of(fit)},
        }
        for fit in (wheel.first, wheel.second, wheel.motor_fit)
    }


def _remarks(wheel: WheelFound) -> list[str]:
    first, second, motor = wheel.first, wheel.second, wheel.motor_fit
    gain = float(second.values[0])
    remarks = [
        f"Wheel {wheel.name}: three models were fitted. Their residuals are"
        f" {first.rms_radps:.3f} rad/s (first order), {second.rms_radps:.3f} rad/s (second order)"
        f" and {motor.rms_radps:.3f} rad/s (a motor in the manual's control loop). By the Akaike"
        f" criterion (AIC), “{wheel.answer.model.title}” is the better of the first two."
    ]
    if wheel.left_out:
        remarks.append(
            f"Wheel {wheel.name}: {wheel.left_out} of {wheel.left_out + len(wheel.steps)} steps"
            " differ from the others and are not used."
        )
    if second.rms_radps > MANY * QUANTUM_RADPS:
        remarks.append(
            f"Wheel {wheel.name} responds differently from step to step, by more than the"
            f" {QUANTUM_RADPS} rad/s that quantisation causes. Check that nothing blocks the wheel,"
            " charge the battery, and reduce the load of this computer."
        )
    if motor.rms_radps > UNEXPLAINED * second.rms_radps:
        remarks.append(
            f"Wheel {wheel.name}: the model of a motor in the manual's control loop fits these"
            " steps worse than the second-order model, so the results for motor and gains are not"
            " valid. Perhaps the gains in the firmware differ from --gains. In this case, calibrate"
            " again with the firmware's gains."
        )
    if abs(gain - 1.0) > UNLIKE_ONE:
        remarks.append(
            f"Wheel {wheel.name} turns {gain:.3f} times as fast as commanded, according to the"
            " board's own odometry: run `calibrate scale` to correct `linear_scale`."
        )
    return remarks


def _told(wheels: list[Behaviour]) -> str:
    """Return a text for the user with the largest value of each characteristic over all wheels."""
    rise_ms, command_ms, load_ms = (
        1000 * max(float(value) for value in values)
        for values in (
            [wheel.rise_s for wheel in wheels],
            [wheel.command_error_s for wheel in wheels],
            [wheel.load_error_s for wheel in wheels],
        )
    )
    overshoot, ms = (
        max(float(value) for value in values)
        for values in ([wheel.overshoot for wheel in wheels], [wheel.ms for wheel in wheels])
    )
    return (
        f"a step of the command has a rise time of at most {rise_ms:.0f} ms and an overshoot of at"
        f" most {100 * overshoot:.0f} %. The integrated error is at most {command_ms:.0f} ms times"
        f" the height of this step. After a step of the load, it is at most {load_ms:.0f} ms times"
        " the height of that step."
        f" The peak of the sensitivity, Ms, is at most {ms:.2f}"
    )
