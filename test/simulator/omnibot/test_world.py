# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the robot's geometry and true pose, and of errors that the board cannot measure."""

from math import cos, pi, sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnibot_driver.simulator.omnibot import BoardSettings
from omnibot_driver.simulator.omnibot.chassis import PlanarPose, body_from_rims, rims_from_body
from omnibot_driver.simulator.omnibot.world import Force, Twist, World

ordinary = st.floats(-10, 10)
L = 0.143


@given(ordinary, ordinary, ordinary)
def test_the_odometry_matrix_inverts_the_velocity_equations(
    vx: float, vy: float, yaw_rate: float
) -> None:
    """A body velocity is converted to rim speeds and back. The result is the same velocity."""
    assert body_from_rims(rims_from_body(vx, vy, yaw_rate, L), L) == pytest.approx(
        (vx, vy, yaw_rate), abs=1e-12
    )


def test_the_velocity_equations_are_those_of_the_manual() -> None:
    """For a motion along x or y, or a turn, the rim speeds are those of the manual's equations."""
    c30 = cos(pi / 6)
    assert rims_from_body(1, 0, 0, L) == pytest.approx((-c30, c30, 0))
    assert rims_from_body(0, 1, 0, L) == pytest.approx((-0.5, -0.5, 1))
    assert rims_from_body(0, 0, 1, L) == pytest.approx((-L, -L, -L))


def test_a_pose_moves_at_the_mean_heading_of_the_step() -> None:
    """One step has a forward motion and a quarter turn. The pose moves along the diagonal."""
    moved = PlanarPose(1.0, 2.0, 0.0).moved(1.0, 0.0, pi / 2)
    assert moved == pytest.approx((1 + sqrt(0.5), 2 + sqrt(0.5), pi / 2))


def drive(settings: BoardSettings, ticks: int = 300) -> World:
    """Drive all wheels forward for this number of ticks, and return the world.

    This turns the robot clockwise on the spot.
    """
    world = World(settings)
    for _ in range(ticks):
        world.advance((1000.0, 1000.0, 1000.0))
    return world


def test_larger_wheels_carry_the_robot_further_than_the_encoders_say() -> None:
    """All wheels are 2 % larger than the board assumes.

    At the same encoder counts, the robot turns 2 % farther.
    """
    plain, large = drive(BoardSettings()), drive(BoardSettings(wheel_radius_scale=(1.02,) * 3))
    assert large.encoders == plain.encoders
    assert large.truth.yaw_rad == pytest.approx(1.02 * plain.truth.yaw_rad)


def test_a_wider_base_turns_less_than_the_encoders_say() -> None:
    """The base radius is 5 % larger than the board assumes.

    At the same encoder counts, the robot turns 5 % less.
    """
    plain, wide = drive(BoardSettings()), drive(BoardSettings(base_radius_scale=1.05))
    assert wide.encoders == plain.encoders
    assert wide.truth.yaw_rad == pytest.approx(plain.truth.yaw_rad / 1.05)


def test_slip_loses_about_its_mean_fraction_of_the_way() -> None:
    """With 10 % slip on average, the robot turns by 90 % of the angle that the encoders show."""
    plain = drive(BoardSettings(), 3000)
    first = drive(BoardSettings(slip=0.1, seed=1), 3000)
    second = drive(BoardSettings(slip=0.1, seed=2), 3000)
    assert first.encoders == plain.encoders
    assert first.truth.yaw_rad == pytest.approx(0.9 * plain.truth.yaw_rad, rel=0.02)
    assert first.truth != second.truth


def test_the_twist_is_the_derivative_of_the_pose() -> None:
    """In a steady turn, the yaw grows by the yaw rate in each second."""
    world = drive(BoardSettings())
    before = world.truth
    world.advance((1000.0, 1000.0, 1000.0))
    assert (world.truth.yaw_rad - before.yaw_rad) / 0.01 == pytest.approx(before.yaw_rate)


def test_a_force_moves_the_robot_in_its_direction() -> None:
    """A force along x or y moves the robot along this axis only. A torque only turns the robot."""
    for force, moved in (((500.0, 0.0, 0.0), 0), ((0.0, 500.0, 0.0), 1), ((0.0, 0.0, 500.0), 2)):
        world = World(BoardSettings())
        world.force = Force(*force)
        for _ in range(100):
            world.advance((0.0, 0.0, 0.0))
        truth = world.truth
        twist = [truth.vx_mps, truth.vy_mps, truth.yaw_rate * L]
        assert twist.pop(moved) > 0.05
        assert twist == pytest.approx([0.0, 0.0], abs=0.02)


def test_a_slope_pulls_the_same_way_whatever_the_heading() -> None:
    """The floor slopes along the x axis. The robot rolls along this axis, whatever its heading."""
    world = World(BoardSettings(slope_pwm=500.0))
    world.gripped = Twist(0.0, 0.0, pi / 2)
    for _ in range(100):
        world.advance((0.0, 0.0, 0.0))
    world.gripped = Twist()
    world.advance((0.0, 0.0, 0.0))
    world.gripped = None
    for _ in range(100):
        world.advance((0.0, 0.0, 0.0))
    assert world.truth.yaw_rad == pytest.approx(pi / 2, abs=0.05)
    assert world.truth.x_m > 0.05
    assert abs(world.truth.y_m) < 0.02


def test_a_gripped_robot_moves_as_it_is_moved_and_its_encoders_count_that() -> None:
    """Someone moves the robot by hand. The motors cannot move it, but the encoders count.

    When the robot is released, the motors move it again, from its new place.
    """
    world = World(BoardSettings())
    world.gripped = Twist(0.1, -0.2, 0.0)
    for _ in range(100):
        world.advance((4000.0, 4000.0, 4000.0))
    assert (world.truth.x_m, world.truth.y_m) == pytest.approx((0.1, -0.2))
    rim_m = 2 * pi * 0.029 / 1560
    rims = rims_from_body(0.1, -0.2, 0.0, L)
    assert [count * rim_m for count in world.encoders] == pytest.approx(rims, abs=2e-4)
    world.gripped = None
    world.advance((4000.0, 4000.0, 4000.0))
    assert world.truth.yaw_rad < 0.0


def test_swapped_motors_get_each_others_effort() -> None:
    """Two motors are swapped, so each gets the effort for the other.

    Each encoder counts its own wheel.
    """
    world = World(BoardSettings(motor_wiring=(2, -1, 3)))
    for _ in range(50):
        world.advance((1000.0, 500.0, 0.0))
    a, b, c = world.encoders
    assert b > -a > 0
    assert c == 0
