# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the calculated control loop of a wheel, its models, and the gains chosen for it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from omnibot_driver.simulator.omnibot import motors as simulated
from omnibot_driver.tools.calibrate import tuning
from omnibot_driver.tools.calibrate.step_models import (
    SPAN_S,
    first_order,
    motor_model,
    second_order,
)
from omnibot_driver.tools.calibrate.tuning import (
    LARGEST_MS,
    LARGEST_OVERSHOOT,
    behaviour,
    better_gains,
)
from omnibot_driver.tools.calibrate.wheel_loop import MANUAL, Gains, Motor, answer, sensitivity_peak
from omnibot_driver.tools.needs import ToolError

wheel_motors = st.builds(Motor, st.floats(15, 120), st.floats(2, 15), st.floats(0, 5))


def simulated_answer(motor: Motor, gains: Gains, ticks: int) -> list[float]:
    """Return the step response of the simulated board, without friction and quantisation."""
    wheel = simulated.Motor(
        simulated.MotorConstants(
            pwm_per_count=motor.pwm_per_count,
            time_constant_ticks=motor.time_constant_ticks,
            friction_pwm=0.0,
            delay_ticks=int(motor.delay_ticks),
        )
    )
    controller = simulated.WheelController(
        simulated.WheelGains(
            feed_forward=gains.feed_forward,
            proportional=gains.proportional,
            integral=gains.integral,
        )
    )
    base, step = 20.0, 10.0  # far from rest, where friction acts
    wheel.speed = base
    turned, speeds = base, []
    for tick in range(-3000, ticks):
        target = base + step * (tick >= 0)
        turned = wheel.advance(controller.update(target, turned))
        speeds.append((turned - base) / step)
    return speeds[3000:]


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_the_loop_is_the_simulated_boards(delay: int) -> None:
    """The calculated loop has the same step response as the simulated board."""
    motor = Motor(46.0, 6.0, float(delay))
    assert answer(motor, MANUAL, 100) == pytest.approx(
        simulated_answer(motor, MANUAL, 100), abs=1e-6
    )


def test_a_part_of_a_tick_lies_between_two_whole_delays() -> None:
    """With a delay of 1.4 ticks, the response lies between those with delays of 1 and 2 ticks."""
    sooner, between, later = (
        answer(Motor(46.0, 6.0, delay), MANUAL, 8) for delay in (1.0, 1.4, 2.0)
    )
    assert (sooner[1:] > between[1:]).all()
    assert (between[1:] > later[1:]).all()


@settings(max_examples=25)
@given(wheel_motors, st.floats(0.02, 3.0))
def test_the_loops_robustness_is_what_a_wave_shows(motor: Motor, frequency: float) -> None:
    """Ms is the largest sensitivity of the control loop, over all frequencies.

    The test computes the sensitivity at a random frequency from the impulse response. This
    value is at most Ms.
    """
    ticks = 4000
    pulse = np.diff(answer(motor, Gains(1.0, 0.0, 0.0), ticks), prepend=0.0)
    z = np.exp(1j * frequency)
    plant = np.sum(pulse * z ** -np.arange(1.0, ticks + 1))
    loop = plant * (MANUAL.proportional + MANUAL.integral / (1 - 1 / z))
    worst = float(sensitivity_peak(motor, MANUAL, points=2000))
    assert 1 / abs(1 + loop) <= worst * (1 + 1e-3)


@settings(max_examples=8)
@given(st.floats(0.01, 0.3), st.floats(0.0, 0.08))
def test_first_order_deltas_are_mean_values(time_constant_s: float, delay_s: float) -> None:
    """The deltas of a first-order wheel agree with scipy's response, integrated numerically."""
    times_s = np.linspace(0.0, 0.6, 6001)
    _, response = signal.step(([1.0], [time_constant_s, 1.0]), T=times_s)
    _check(first_order, np.array([time_constant_s, delay_s]), times_s, response, delay_s)


@settings(max_examples=8)
@given(
    st.floats(3.0, 40.0),
    st.floats(0.2, 3.0),
    st.one_of(st.floats(-0.05, -0.001), st.floats(0.001, 0.4)),
    st.floats(0.0, 0.08),
)
def test_second_order_deltas_are_mean_values(
    omega: float, damping: float, zero_s: float, delay_s: float
) -> None:
    """The deltas of a second-order wheel agree with scipy's response, integrated numerically.

    The damping is arbitrary, and the zero is in either half-plane.
    """
    times_s = np.linspace(0.0, 0.6, 6001)
    system = ([zero_s, 1.0], [1 / omega**2, 2 * damping / omega, 1.0])
    _, response = signal.step(system, T=times_s)
    parameters = np.array([omega, damping, zero_s, delay_s])
    _check(second_order, parameters, times_s, response, delay_s)


def _check(turned, parameters, times_s, response, delay_s) -> None:  # type: ignore[no-untyped-def]
    integral = np.concatenate(([0.0], np.cumsum((response[1:] + response[:-1]) / 2))) * 1e-4
    ends_s = np.array([0.0, 0.013, 0.04, 0.11, 0.37])
    expected = np.interp(ends_s - delay_s, times_s, integral) - np.interp(
        ends_s - SPAN_S - delay_s, times_s, integral
    )
    found = turned(parameters, ends_s) - turned(parameters, ends_s - SPAN_S)
    assert found == pytest.approx(expected, abs=2e-5)


def test_two_equal_poles_are_no_exception() -> None:
    """The damping is 1, so both poles are equal.

    The response lies between the responses with dampings of 0.99 and 1.01.
    """
    low, mid, high = (
        second_order(np.array([10.0, damping, 0.0, 0.0]), np.array([0.2]))
        for damping in (0.99, 1.0, 1.01)
    )
    assert low > mid > high


def test_a_motor_in_the_loop_turns_by_what_the_loop_says() -> None:
    """The calculated angle of a motor is the sum of the calculated speeds times the tick period."""
    model = motor_model(MANUAL)
    turned = model.turned(np.array([46.0, 0.06, 0.01]), np.array([-0.1, 0.0, 0.01, 0.05]))
    speeds = answer(Motor(46.0, 6.0, 1.0), MANUAL, 5)
    assert turned == pytest.approx([0.0, 0.0, speeds[0] * 0.01, speeds.sum() * 0.01])


@settings(max_examples=3)
@given(wheel_motors)
def test_better_gains_are_better_and_within_the_limits(motor: Motor) -> None:
    """The proposed gains keep the limits of Ms (maximum sensitivity) and overshoot.

    The error after a load change is smaller than with the manual's gains. If this error is smaller
    by 20 %, the error after a command may be larger, but by less than 20 %.
    """
    gains = better_gains([motor])
    before, after = behaviour(motor, MANUAL), behaviour(motor, gains)
    assert after.ms <= LARGEST_MS
    assert after.overshoot <= LARGEST_OVERSHOOT
    assert gains.proportional <= motor.pwm_per_count
    assert after.load_error_s < before.load_error_s
    assert (
        after.command_error_s / before.command_error_s + after.load_error_s / before.load_error_s
        < 2
    )


def test_if_no_gains_are_within_the_limits_none_are_proposed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The limit of Ms is below 1, which no loop can reach. The tool reports an error."""
    monkeypatch.setattr(tuning, "LARGEST_MS", 0.9)
    with pytest.raises(
        ToolError, match=r"no gains limit the peak of the sensitivity \(Ms\) to 0\.9"
    ):
        better_gains([Motor(46.0, 6.0, 0.0)])


def test_gains_for_three_motors_keep_within_the_limits_on_each() -> None:
    """The tool proposes one set of gains for three motors.

    With these gains, each motor keeps the limits.
    """
    motors = [Motor(46.0, 6.0, 0.0), Motor(35.0, 10.0, 1.0), Motor(60.0, 4.0, 3.0)]
    gains = better_gains(motors)
    for motor in motors:
        behaves = behaviour(motor, gains)
        assert behaves.ms <= LARGEST_MS
        assert behaves.overshoot <= LARGEST_OVERSHOOT


def test_what_is_predicted_comes_about() -> None:
    """The simulated board runs with the proposed gains.

    The overshoot and the error of its response agree with the predicted ones.
    """
    motor = Motor(46.0, 6.0, 2.0)
    gains = better_gains([motor])
    speeds = np.array(simulated_answer(motor, gains, 200))
    said = behaviour(motor, gains)
    assert max(0.0, speeds.max() - 1) == pytest.approx(float(said.overshoot), abs=1e-3)
    assert np.abs(speeds - 1).sum() * 0.01 == pytest.approx(float(said.command_error_s), rel=0.01)
