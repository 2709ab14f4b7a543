# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Kinematics of three omni wheels, checked with the equations of the manual."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import twists, wheel_rates

from omnibot_driver.core.geometry.omni import OmniKinematics
from omnibot_driver.core.geometry.twist import BodyTwist

R, L = 0.029, 0.143
MANUAL = OmniKinematics(wheel_radius_m=R, base_radius_m=L)
SQRT3 = 1.7320508075688772


def close(values: tuple[float, ...], rel: float = 1e-12, abs_: float = 1e-9) -> object:
    return pytest.approx(values, rel=rel, abs=abs_)


def as_tuple(twist: BodyTwist) -> tuple[float, float, float]:
    return twist.vx_mps, twist.vy_mps, twist.yaw_rate_radps


@given(twists)
def test_wheel_rates_are_the_velocity_equations_of_the_manual(twist: BodyTwist) -> None:
    """The wheel rates are the rim speeds of the manual's equations, divided by the wheel radius."""
    vx, vy, omega = as_tuple(twist)
    rim_a = -0.8660254037844386 * vx - 0.5 * vy - 0.143 * omega
    rim_b = 0.8660254037844386 * vx - 0.5 * vy - 0.143 * omega
    rim_c = vy - 0.143 * omega
    assert MANUAL.wheel_rates(twist) == close((rim_a / R, rim_b / R, rim_c / R))


@given(wheel_rates)
def test_the_body_twist_is_the_odometry_matrix_of_the_manual(
    rates: tuple[float, float, float],
) -> None:
    """The body twist is computed from wheel rates with the odometry matrix of the manual.

    Of the manual's two forms of this matrix, only the form with 1/(2 cos 30°) is right.
    """
    a, b, c = (rate * 0.029 for rate in rates)
    one = 0.5773502691896258
    expected = (
        -one * a + one * b + 0.0 * c,
        -0.3333333333333333 * a - 0.3333333333333333 * b + 0.6666666666666666 * c,
        -2.331002331002331 * (a + b + c),
    )
    assert as_tuple(MANUAL.body_twist(rates)) == close(expected)


@given(twists, st.floats(0.001, 1.0), st.floats(0.01, 2.0))
def test_wheels_and_back_is_the_same_twist(twist: BodyTwist, radius: float, base: float) -> None:
    """A twist is converted to wheel rates and back, for any size of robot. Nothing is lost."""
    kinematics = OmniKinematics(wheel_radius_m=radius, base_radius_m=base)
    back = kinematics.body_twist(kinematics.wheel_rates(twist))
    assert as_tuple(back) == close(as_tuple(twist), rel=1e-9)


@given(wheel_rates, st.floats(0.001, 1.0), st.floats(0.01, 2.0))
def test_body_and_back_is_the_same_wheels(
    rates: tuple[float, float, float], radius: float, base: float
) -> None:
    """Wheel rates are converted to a twist and back, for any size of robot. Nothing is lost."""
    kinematics = OmniKinematics(wheel_radius_m=radius, base_radius_m=base)
    assert kinematics.wheel_rates(kinematics.body_twist(rates)) == close(rates, rel=1e-9, abs_=1e-7)


def test_forward_turns_a_back_and_b_forth_and_leaves_c_alone() -> None:
    """The robot drives forward at 1 m/s.

    The rims of A and B move at ∓cos 30° m/s, and C is at rest.
    """
    a, b, c = MANUAL.wheel_rates(BodyTwist(1.0, 0.0, 0.0))
    assert (a, b, c) == close((-SQRT3 / 2 / R, SQRT3 / 2 / R, 0.0))


def test_left_turns_c_forth_and_a_and_b_back_at_half_its_rate() -> None:
    """The robot drives to the left at 1 m/s.

    The rim of C moves at 1 m/s, those of A and B at −0.5 m/s.
    """
    assert MANUAL.wheel_rates(BodyTwist(0.0, 1.0, 0.0)) == close((-0.5 / R, -0.5 / R, 1.0 / R))


def test_a_left_turn_turns_all_wheels_back_alike() -> None:
    """In a left turn at 1 rad/s, each rim moves at -L m/s, where L is the base radius in m.

    The right turn, with all wheels forward, is the manual's «rotate all».
    """
    assert MANUAL.wheel_rates(BodyTwist(0.0, 0.0, 1.0)) == close((-L / R, -L / R, -L / R))
    assert MANUAL.body_twist((1.0, 1.0, 1.0)).yaw_rate_radps < 0
