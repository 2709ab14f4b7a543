# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Kinematics of a steered wheel in front of a driven axle, checked with turns computed by hand."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import twists

from omnibot_driver.core.geometry.steered import SteeredKinematics
from omnibot_driver.core.geometry.twist import BodyTwist

ROBOT = SteeredKinematics(wheel_radius_m=0.1, track_m=0.4, wheelbase_m=0.5)
sizes = st.builds(
    SteeredKinematics, st.floats(0.01, 0.5), st.floats(0.05, 2.0), st.floats(0.05, 2.0)
)


def triple(twist: BodyTwist) -> tuple[float, float, float]:
    return twist.vx_mps, twist.vy_mps, twist.yaw_rate_radps


@pytest.mark.parametrize(
    ("twist", "degrees"),
    [
        ((1.0, 0.0, 0.0), 0.0),
        ((-1.0, 0.0, 0.0), 0.0),
        ((0.5, 0.0, 1.0), 45.0),  # centre 0.5 m to the left; the wheel is 0.5 m ahead
        ((0.5, 0.0, -1.0), -45.0),
        ((-0.5, 0.0, 1.0), -45.0),  # backwards, centre 0.5 m to the right
        ((0.0, 0.0, 1.0), 90.0),
        ((0.0, 0.0, -1.0), -90.0),
        ((0.0, 0.0, 0.0), 0.0),
    ],
)
def test_the_wheel_is_steered_across_the_line_to_the_centre_of_rotation(
    twist: tuple[float, float, float], degrees: float
) -> None:
    """For each of eight twists, the steering angle equals the angle that was worked out by hand."""
    assert math.degrees(ROBOT.steering_rad(BodyTwist(*twist))) == pytest.approx(degrees)


def test_what_the_steered_wheel_does_to_the_body() -> None:
    """A wheel 0.5 m in front of the axle, at 1 m/s and 45°, moves the robot at 0.707 m/s.

    The robot turns at 1.41 rad/s.
    """
    twist = ROBOT.steered_twist(1.0, math.pi / 4)
    assert triple(twist) == pytest.approx((math.sqrt(0.5), 0.0, math.sqrt(2.0)))


def test_the_driven_wheels_run_on_circles_about_the_same_centre() -> None:
    """The robot turns about a point 0.5 m to its left.

    The wheels run on circles with radii of 0.3 and 0.7 m.
    """
    assert ROBOT.wheel_rates(BodyTwist(0.5, 0.0, 1.0)) == pytest.approx((3.0, 7.0))


@given(sizes, twists)
def test_wheels_and_back_is_the_feasible_part(robot: SteeredKinematics, twist: BodyTwist) -> None:
    """A twist is converted to wheel rates and back. Only the sideways velocity is lost."""
    back = robot.body_twist(robot.wheel_rates(twist))
    assert triple(back) == pytest.approx(triple(robot.feasible(twist)), rel=1e-9, abs=1e-9)


@given(sizes, twists)
def test_the_steered_wheel_tells_the_same_twist(robot: SteeredKinematics, twist: BodyTwist) -> None:
    """A twist is converted to the steered wheel's angle and speed, and back. Nothing is lost."""
    wanted = robot.feasible(twist)
    speed_mps = math.hypot(wanted.vx_mps, robot.wheelbase_m * wanted.yaw_rate_radps)
    speed_mps = math.copysign(speed_mps, wanted.vx_mps) if wanted.vx_mps else speed_mps
    angle_rad = robot.steering_rad(wanted)
    assert -math.pi / 2 <= angle_rad <= math.pi / 2
    told = robot.steered_twist(speed_mps, angle_rad)
    assert triple(told) == pytest.approx(triple(wanted), rel=1e-9, abs=1e-9)
