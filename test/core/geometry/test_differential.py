# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Kinematics of two wheels on one axle, checked with turns that are worked out by hand."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import twists

from omnibot_driver.core.geometry.differential import DifferentialKinematics
from omnibot_driver.core.geometry.twist import BodyTwist

ROBOT = DifferentialKinematics(wheel_radius_m=0.1, track_m=0.4)
rates = st.tuples(*[st.floats(-50.0, 50.0)] * 2)
sizes = st.builds(DifferentialKinematics, st.floats(0.01, 0.5), st.floats(0.05, 2.0))


def triple(twist: BodyTwist) -> tuple[float, float, float]:
    return twist.vx_mps, twist.vy_mps, twist.yaw_rate_radps


def test_straight_ahead_both_wheels_roll_alike() -> None:
    """The robot drives forward at 1 m/s.

    Both wheels have a radius of 0.1 m and turn at 10 rad/s.
    """
    assert ROBOT.wheel_rates(BodyTwist(1.0, 0.0, 0.0)) == pytest.approx((10.0, 10.0))


def test_a_left_turn_on_the_spot_rolls_left_back_and_right_forward() -> None:
    """In a left turn on the spot at 1 rad/s, the wheels turn at -2 and 2 rad/s.

    Each wheel is 0.2 m from the centre and has a radius of 0.1 m.
    """
    assert ROBOT.wheel_rates(BodyTwist(0.0, 0.0, 1.0)) == pytest.approx((-2.0, 2.0))


def test_about_a_centre_one_metre_to_the_left_the_wheels_run_on_two_circles() -> None:
    """The wheels run at 0.4 m/s and 0.6 m/s about a point 1 m to the left of the robot.

    The robot moves at 0.5 m/s and turns at 0.5 rad/s.
    """
    assert triple(ROBOT.body_twist((4.0, 6.0))) == pytest.approx((0.5, 0.0, 0.5))


def test_about_a_wheel_that_stands() -> None:
    """The right wheel is at rest, and the left wheel moves at 0.4 m/s.

    The robot turns at −1 rad/s and moves at 0.2 m/s.
    """
    assert triple(ROBOT.body_twist((4.0, 0.0))) == pytest.approx((0.2, 0.0, -1.0))


@given(sizes, twists)
def test_wheels_and_back_is_the_feasible_part(
    robot: DifferentialKinematics, twist: BodyTwist
) -> None:
    """A twist is converted to wheel rates and back. Only the sideways velocity is lost."""
    back = robot.body_twist(robot.wheel_rates(twist))
    assert triple(back) == pytest.approx(triple(robot.feasible(twist)), rel=1e-9, abs=1e-9)
    assert robot.feasible(twist).vy_mps == 0.0


@given(sizes, rates)
def test_body_and_back_is_the_same_wheels(
    robot: DifferentialKinematics, wheel_rates: tuple[float, float]
) -> None:
    """Wheel rates are converted to a twist and back. Nothing is lost."""
    back = robot.wheel_rates(robot.body_twist(wheel_rates))
    assert back == pytest.approx(wheel_rates, rel=1e-9, abs=1e-7)


@given(sizes, rates)
def test_each_wheel_rolls_about_the_instantaneous_centre(
    robot: DifferentialKinematics, wheel_rates: tuple[float, float]
) -> None:
    """A robot turns about a point.

    The speed of each rim is the yaw rate times the wheel's distance from this point.
    """
    twist = robot.body_twist(wheel_rates)
    if abs(twist.yaw_rate_radps) < 1e-3:
        return
    centre_m = twist.vx_mps / twist.yaw_rate_radps
    for rate, y_m in zip(wheel_rates, (robot.track_m / 2, -robot.track_m / 2), strict=True):
        rim_mps = rate * robot.wheel_radius_m
        assert math.isclose(
            rim_mps, twist.yaw_rate_radps * (centre_m - y_m), rel_tol=1e-9, abs_tol=1e-9
        )
