# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of a single wheel: how motor and controller respond to a step of the commanded speed."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from omnibot_driver.simulator.omnibot.motors import DEAD_ZONE_PWM, PWM_LIMIT, Motor, WheelController


class Wheel:
    """A motor and its controller. The controller measures the speed by the encoder."""

    def __init__(self) -> None:
        self.motor = Motor()
        self.controller = WheelController()
        self.pwm = 0.0
        self.speeds: list[float] = []
        self._encoder = self.motor.encoder

    def hold(self, target: float, ticks: int) -> list[float]:
        """Run the controller for ``ticks``, and return the true speed after each tick."""
        speeds = []
        for _ in range(ticks):
            self.motor.advance(self.pwm)
            encoder = self.motor.encoder
            self.pwm = self.controller.update(target, encoder - self._encoder)
            self._encoder = encoder
            speeds.append(self.motor.speed)
        return speeds


@pytest.mark.parametrize("target", [12.2, 41.6, 73.4, -41.6])
def test_a_step_rises_quickly_with_little_overshoot_and_no_lasting_error(target: float) -> None:
    """The wheel reaches 90 % of the commanded speed in 0.2 s, and overshoots by less than 5 %.

    After 2 s the error is below 0.5 %.
    """
    speeds = [speed / target for speed in Wheel().hold(target, 300)]
    assert speeds[20] > 0.9
    assert max(speeds) < 1.05
    assert sum(speeds[200:]) / 100 == pytest.approx(1.0, abs=0.005)


@pytest.mark.parametrize("target", [12.2, 41.6, 73.4, 300.0])
def test_a_stopped_wheel_comes_to_rest_and_stays(target: float) -> None:
    """A wheel is stopped. After 2 s it is at rest, and the controller does not move it again."""
    wheel = Wheel()
    wheel.hold(target, 200)
    wheel.hold(0.0, 200)
    assert set(wheel.hold(0.0, 500)) == {0.0}


def test_saturation_does_not_wind_up_the_integrator() -> None:
    """A speed that the motor cannot reach is commanded for 10 s or for 1 s.

    Afterwards, a slow speed is reached equally soon in both cases.
    """
    long, short = Wheel(), Wheel()
    long.hold(300.0, 1000)
    short.hold(300.0, 100)
    assert long.hold(20.0, 100) == pytest.approx(short.hold(20.0, 100), abs=1.5)


def test_the_effort_saturates() -> None:
    """The controller's PWM never exceeds its range in either direction."""
    assert WheelController().update(1e6, 0) == PWM_LIMIT
    assert WheelController().update(-1e6, 0) == -PWM_LIMIT


def test_efforts_within_the_dead_zone_move_nothing() -> None:
    """An effort within the dead zone does not turn a resting wheel. A larger effort turns it."""
    motor = Motor()
    assert motor.advance(DEAD_ZONE_PWM) == 0.0
    assert motor.advance(-DEAD_ZONE_PWM) == 0.0
    assert motor.advance(DEAD_ZONE_PWM + 1) > 0.0


@given(
    st.lists(st.floats(-PWM_LIMIT, PWM_LIMIT), min_size=1, max_size=30).map(
        lambda efforts: [effort for effort in efforts for _ in range(5)]
    )
)
@settings(max_examples=50)
def test_friction_never_drives_a_wheel(efforts: list[float]) -> None:
    """Friction only slows a wheel down.

    A wheel changes its direction only if the effort of its motor acts in the new direction.
    """
    motor = Motor()
    for effort in efforts:
        before = motor.speed
        turned = motor.advance(effort)
        assert turned * before >= 0 or turned * effort > 0


@given(st.floats(-90, 90))
@settings(max_examples=50)
def test_a_motor_without_power_stops_within_a_third_of_a_second(speed: float) -> None:
    """A turning motor loses its power. Friction stops it within 0.33 s, without reversing it."""
    motor = Motor()
    motor.speed = speed
    turned = [motor.advance(0.0) for _ in range(33)]
    assert motor.speed == 0.0
    assert all(step * speed >= 0 for step in turned)
