# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of ``calibrate step``, which finds the constants of a wheel by its encoder deltas."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from wheel_bench import LEVELS, steps_to_and_fro

from omnibot_driver.simulator.omnibot.motors import MotorConstants, WheelGains
from omnibot_driver.tools.calibrate.step_fit import Step, aligned, fit, fit_wheel, steps_of
from omnibot_driver.tools.calibrate.step_models import FIRST_ORDER, SECOND_ORDER, Model, motor_model
from omnibot_driver.tools.calibrate.step_result import UNEXPLAINED, result_of
from omnibot_driver.tools.calibrate.wheel_loop import MANUAL, TICK_S, Gains
from omnibot_driver.tools.needs import ToolError

NOISE_RADPS = 0.05
"""Noise of a wheel rate, in rad/s. The resolution of the encoder and of the protocol causes it."""
TOLERANCE = 0.01
"""Relative tolerance of a motor's constants. Only the delay has another tolerance, 1 ms."""


def made_up(model: Model, values: tuple[float, ...], seed: int) -> list[Step]:
    """Return eight steps of a simulated wheel: the response of ``model`` with noise."""
    random = np.random.default_rng(seed)
    steps = []
    for number in range(8):
        before, after = LEVELS if number % 2 else LEVELS[::-1]
        step = Step(
            before, after, np.arange(-8.0 + number % 4, 100.0, 4.0), np.array([]), after, 120
        )
        rates = values[0] * step.told_by(
            lambda ticks: model.mean(np.array(values[1:]), ticks * TICK_S)
        )
        noise = NOISE_RADPS * random.standard_normal(len(rates))
        steps.append(replace(step, rate_radps=rates + noise))
    return steps


@settings(max_examples=20)
@given(st.floats(0.8, 1.2), st.floats(0.03, 0.2), st.floats(0.0, 0.06), st.integers(0, 2**32 - 1))
def test_a_first_order_is_found(gain: float, lag_s: float, delay_s: float, seed: int) -> None:
    """The fit finds the parameters of a wheel that is a system of first order.

    Each error is less than five times the standard deviation that the fit gives for the parameter.
    """
    planted = (gain, lag_s, delay_s)
    found = fit(FIRST_ORDER, made_up(FIRST_ORDER, planted, seed))
    assert (np.abs(found.values - planted) < 5 * found.sigmas + 1e-6).all()
    assert found.rms_radps == pytest.approx(NOISE_RADPS, rel=0.2)


@settings(max_examples=15)
@given(
    st.floats(20.0, 90.0), st.floats(0.03, 0.15), st.floats(0.0, 0.04), st.integers(0, 2**32 - 1)
)
def test_a_motor_is_found_in_the_manuals_loop(
    pwm_per_count: float, lag_s: float, delay_s: float, seed: int
) -> None:
    """The fit finds the parameters of a motor in a control loop with the gains of the manual.

    Each error is below five standard deviations. A model of first order does not fit better.
    """
    planted = (1.0, pwm_per_count, lag_s, delay_s)
    steps = made_up(motor_model(MANUAL), planted, seed)
    found = fit(motor_model(MANUAL), steps)
    assert (np.abs(found.values - planted) < 5 * found.sigmas + 1e-6).all()
    assert found.rms_radps < 1.02 * min(fit(FIRST_ORDER, steps).rms_radps, NOISE_RADPS * 1.3)


def test_claimed_uncertainties_are_the_true_ones() -> None:
    """30 recordings are fitted. The claimed uncertainties agree with the true errors.

    An error divided by its claimed uncertainty has a standard deviation near 1.
    """
    planted = (1.0, 46.0, 0.06, 0.013)
    fits = [fit(motor_model(MANUAL), made_up(motor_model(MANUAL), planted, n)) for n in range(30)]
    errors = np.array([(one.values - planted) / one.sigmas for one in fits])
    assert 0.7 < errors.std() < 1.3


def test_a_command_seen_a_tick_off_is_put_right() -> None:
    """Some steps begin one tick too late or too early. The fit corrects this."""
    planted = (1.0, 0.05, 0.02)
    steps = made_up(FIRST_ORDER, planted, 1)
    steps[2], steps[5] = steps[2].sooner(1), steps[5].sooner(-1)
    found = fit(FIRST_ORDER, aligned(steps, FIRST_ORDER))
    assert found.values == pytest.approx(planted, rel=0.02)


def test_late_commands_are_put_right_and_a_stall_is_left_out() -> None:
    """Some commands are up to 0.15 s late, and in one step the wheel is blocked.

    The fit corrects the delays and omits the blocked step.
    """
    planted = (1.0, 46.0, 0.06, 0.01)
    steps = made_up(motor_model(MANUAL), planted, 2) + made_up(motor_model(MANUAL), planted, 3)
    for number, ticks in ((1, 3), (4, 15), (9, 7)):
        steps[number] = steps[number].sooner(ticks)
    steps[6].rate_radps[10:15] = 0.0
    found = fit_wheel("A", steps, MANUAL)
    assert found.left_out == 1
    assert found.motor_fit.values == pytest.approx(planted, rel=0.02, abs=1e-3)
    assert found.motor_fit.rms_radps == pytest.approx(NOISE_RADPS, rel=0.1)


def test_a_wheel_that_answers_differently_each_time_is_said() -> None:
    """A wheel responds differently from step to step. A note warns of this."""
    random = np.random.default_rng(5)
    steps = made_up(FIRST_ORDER, (1.0, 0.06, 0.0), 1) + made_up(FIRST_ORDER, (1.0, 0.06, 0.0), 2)
    for step in steps:
        step.rate_radps[3:] += random.uniform(-1, 1)
    notes = result_of([fit_wheel("A", steps, MANUAL)], MANUAL).notes
    assert any("differently from step to step" in note for note in notes)


@pytest.mark.parametrize(
    "planted",
    [
        MotorConstants(),
        MotorConstants(delay_ticks=2),
        MotorConstants(pwm_per_count=35.0, time_constant_ticks=10.0, delay_ticks=1),
        MotorConstants(pwm_per_count=60.0, time_constant_ticks=4.0, delay_ticks=3),
        MotorConstants(friction_pwm=55.0, pwm_per_count=80.0),
    ],
)
def test_the_simulated_boards_motor_is_found(planted: MotorConstants) -> None:
    """A motor is simulated with encoder, friction and the firmware's control loop.

    The motor's constants are found within 1 %, and its delay within 1 ms.
    """
    steps = steps_of(*steps_to_and_fro(planted), 0, LEVELS)
    motor = fit_wheel("A", steps, MANUAL).motor
    assert motor.pwm_per_count == pytest.approx(planted.pwm_per_count, rel=TOLERANCE)
    assert motor.time_constant_ticks == pytest.approx(planted.time_constant_ticks, rel=TOLERANCE)
    assert motor.delay_ticks == pytest.approx(planted.delay_ticks, abs=0.1)


def test_other_gains_must_be_told() -> None:
    """The gains in the firmware differ from those in the manual.

    The model fits well only with the gains in the firmware.
    """
    gains = WheelGains(feed_forward=15.0, proportional=40.0, integral=5.0)
    steps = steps_of(*steps_to_and_fro(MotorConstants(), gains), 0, LEVELS)
    told = fit_wheel("A", steps, Gains(15.0, 40.0, 5.0))
    assert told.motor.pwm_per_count == pytest.approx(46.0, rel=TOLERANCE)
    assert told.motor_fit.rms_radps < 1.1 * told.second.rms_radps
    untold = fit_wheel("A", steps, MANUAL)
    assert untold.motor_fit.rms_radps > UNEXPLAINED * untold.second.rms_radps


def test_rise_and_overshoot_are_those_of_the_answer() -> None:
    """A response of first order rises in 2.2 time constants and does not overshoot."""
    traits = fit(FIRST_ORDER, made_up(FIRST_ORDER, (1.0, 0.1, 0.0), 3)).traits()
    rise_s, sigma_s = traits["rise time"]
    assert rise_s == pytest.approx(0.22, abs=5 * sigma_s + 2e-3)
    assert traits["overshoot"] == (0.0, 0.0)


def test_a_damped_swing_overshoots_as_the_books_say() -> None:
    """The overshoot of a second-order system without a zero is exp(-pi zeta / sqrt(1 - zeta^2))."""
    swinging = made_up(SECOND_ORDER, (1.0, 12.0, 0.5, 0.0, 0.01), 4)
    overshoot, sigma = fit(SECOND_ORDER, swinging).traits()["overshoot"]
    assert overshoot == pytest.approx(0.163, abs=5 * sigma + 0.003)


def test_lost_deltas_are_left_out() -> None:
    """A fifth of the encoder deltas is lost. The fit still finds ``pwm_per_count`` within 2 %."""
    commands, wheels = steps_to_and_fro(MotorConstants())
    kept = np.random.default_rng(1).random(len(wheels.stamp_s)) > 0.2
    thinned = replace(
        wheels,
        stamp_s=wheels.stamp_s[kept],
        angle_rad=wheels.angle_rad[kept],
        rate_radps=wheels.rate_radps[kept],
    )
    motor = fit_wheel("A", steps_of(commands, thinned, 0, LEVELS), MANUAL).motor
    assert motor.pwm_per_count == pytest.approx(46.0, rel=2 * TOLERANCE)


def test_odometry_that_was_lost_is_said() -> None:
    """The odometry ends after five deltas, so the log has no complete step.

    ``steps_of`` therefore raises ToolError.
    """
    commands, wheels = steps_to_and_fro(MotorConstants(), steps=2)
    silent = replace(
        wheels,
        stamp_s=wheels.stamp_s[:5],
        angle_rad=wheels.angle_rad[:5],
        rate_radps=wheels.rate_radps[:5],
    )
    with pytest.raises(ToolError, match="odometry was lost"):
        steps_of(commands, silent, 0, LEVELS)
