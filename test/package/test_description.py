# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the robot's description: xacro expands it, and the URDF parser of ROS tools reads it."""

import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnibot_driver.boards.omnibot import PARAMETERS
from omnibot_driver.core.geometry.omni import OmniKinematics
from omnibot_driver.core.geometry.twist import BodyTwist

xacro = pytest.importorskip("xacro")
URDF = pytest.importorskip("urdf_parser_py.urdf").URDF

ROOT = Path(__file__).parents[2]
WHEELS = ("wheel_a_joint", "wheel_b_joint", "wheel_c_joint")
GEOMETRY = {"wheel_radius": 0.029, "base_radius": 0.143}

Vector = tuple[float, float, float]
speeds = st.floats(-2.0, 2.0)


def description(**arguments: str) -> Any:
    """Return the parsed URDF for these xacro arguments."""
    document = xacro.process_file(str(ROOT / "urdf/omnibot.urdf.xacro"), mappings=arguments)
    return URDF.from_xml_string(document.toxml())


ROBOT = description()


def cross(a: Vector, b: Vector) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def dot(a: Vector, b: Vector) -> float:
    return sum(x * y for x, y in zip(a, b, strict=True))


def rotate(rpy: Vector, vector: Vector) -> Vector:
    """Rotate a vector by roll, then pitch, then yaw about fixed axes, as in URDF."""
    roll, pitch, yaw = rpy
    x, y, z = vector
    y, z = y * math.cos(roll) - z * math.sin(roll), y * math.sin(roll) + z * math.cos(roll)
    x, z = x * math.cos(pitch) + z * math.sin(pitch), -x * math.sin(pitch) + z * math.cos(pitch)
    x, y = x * math.cos(yaw) - y * math.sin(yaw), x * math.sin(yaw) + y * math.cos(yaw)
    return x, y, z


def floor_speed(joint: Any, rate_radps: float, radius_m: float) -> tuple[Vector, Vector]:
    """Return the position of a wheel in m, and the velocity of its centre over the ground in m/s.

    The wheel rolls without slip.
    """
    axle = rotate(tuple(joint.origin.rpy), tuple(joint.axis))
    spin = tuple(rate_radps * part for part in axle)
    touching = cross(spin, (0.0, 0.0, -radius_m))
    return tuple(joint.origin.xyz), tuple(-part for part in touching)


def test_the_joints_are_those_of_joint_states() -> None:
    """Only the three wheels can turn, and their joints have the names from joint_states."""
    turning = [joint.name for joint in ROBOT.joints if joint.type != "fixed"]
    assert turning == list(WHEELS)
    assert {ROBOT.joint_map[name].type for name in WHEELS} == {"continuous"}


def test_the_frames_are_those_of_the_driver() -> None:
    """In the description, base_link has no parent: it is the root.

    A frame can have only one parent, and the driver publishes odom as the parent of base_link.
    """
    assert ROBOT.get_root() == PARAMETERS.by_name["base_frame"].default
    assert {PARAMETERS.by_name["imu_frame"].default, "base_footprint"} < set(ROBOT.link_map)


def test_the_default_geometry_is_the_drivers() -> None:
    """The description, the parameters and the manual have the same radii."""
    for name, manual_m in GEOMETRY.items():
        assert PARAMETERS.by_name[name].default == manual_m
    for name in WHEELS:
        x, y, _ = ROBOT.joint_map[name].origin.xyz
        assert math.hypot(x, y) == pytest.approx(GEOMETRY["base_radius"])
        (collision,) = ROBOT.link_map[name.replace("joint", "link")].collisions
        assert collision.geometry.radius == GEOMETRY["wheel_radius"]


@given(speeds, speeds, speeds)
def test_turning_joints_move_the_body_as_the_kinematics_say(vx: float, vy: float, w: float) -> None:
    """Wheels that turn at the rates of the driver's kinematics move the body as commanded.

    Only each wheel's rolling direction is compared, because the rollers allow sideways motion.
    """
    kinematics = OmniKinematics(
        wheel_radius_m=GEOMETRY["wheel_radius"], base_radius_m=GEOMETRY["base_radius"]
    )
    rates = kinematics.wheel_rates(BodyTwist(vx, vy, w))
    for name, rate in zip(WHEELS, rates, strict=True):
        joint = ROBOT.joint_map[name]
        place, rolling = floor_speed(joint, rate, GEOMETRY["wheel_radius"])
        _, direction = floor_speed(joint, 1.0, 1.0)
        body = (vx - w * place[1], vy + w * place[0], 0.0)
        assert dot(direction, direction) == pytest.approx(1.0)
        assert dot(rolling, direction) == pytest.approx(dot(body, direction), abs=1e-9)


def test_a_positive_wheel_turns_counter_clockwise_seen_from_outside() -> None:
    """The axles of the description point away from the robot's centre.

    Seen from outside, a wheel with a positive rate therefore turns counter-clockwise, as the
    commissioning guide says.
    """
    for name in WHEELS:
        joint = ROBOT.joint_map[name]
        x, y, _ = joint.origin.xyz
        axle = rotate(tuple(joint.origin.rpy), tuple(joint.axis))
        assert dot(axle, (x, y, 0.0)) == pytest.approx(GEOMETRY["base_radius"])


def test_the_wheels_stand_on_the_ground() -> None:
    """base_footprint lies one wheel radius below the axles."""
    ground = ROBOT.joint_map["base_footprint_joint"].origin.xyz[2]
    for name in WHEELS:
        height = ROBOT.joint_map[name].origin.xyz[2]
        assert height - ground == pytest.approx(GEOMETRY["wheel_radius"])


def test_the_imu_hangs_upside_down() -> None:
    """In the robot's description, the IMU is at the position that the vendor's drivers use.

    The z axis of the IMU points down, and the x axis forward.
    """
    joint = ROBOT.joint_map["imu_joint"]
    assert (joint.parent, joint.child) == ("base_link", "imu_link")
    assert joint.origin.xyz == [-0.005, 0.035, -0.06]
    rpy = tuple(joint.origin.rpy)
    assert rotate(rpy, (0.0, 0.0, 1.0)) == pytest.approx((0.0, 0.0, -1.0), abs=1e-6)
    assert rotate(rpy, (1.0, 0.0, 0.0)) == pytest.approx((1.0, 0.0, 0.0), abs=1e-6)


def test_another_robot_is_described_by_arguments() -> None:
    """xacro arguments describe a bigger robot with its IMU at another place, without a new file."""
    robot = description(
        wheel_radius="0.05",
        base_radius="0.2",
        base_height="0.2",
        imu_rpy="0 0 1.5",
        imu_xyz="0 0 0",
    )
    x, y, z = robot.joint_map["wheel_b_joint"].origin.xyz
    assert (math.hypot(x, y), z) == pytest.approx((0.2, 0.05 - 0.2))
    assert robot.joint_map["imu_joint"].origin.rpy == [0.0, 0.0, 1.5]


def test_the_description_needs_no_other_files() -> None:
    """The description contains only primitives, so it looks the same in every viewer."""
    text = (ROOT / "urdf/omnibot.urdf.xacro").read_text()
    assert "package://" not in text
    assert "<mesh" not in text
