# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the configuration of Nav2 and of the EKF for a Fejemis, and of its description."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from omnibot_driver.boards.fejemis import PARAMETERS, kinematics
from omnibot_driver.boards.fejemis_topics import RANGES

xacro = pytest.importorskip("xacro")
URDF = pytest.importorskip("urdf_parser_py.urdf").URDF

ROOT = Path(__file__).parents[3]
LINEAR, ANGULAR, TIMEOUT = (
    PARAMETERS.by_name[name].default
    for name in ("max_linear_speed", "max_angular_speed", "cmd_vel_timeout")
)
STATES = (
    *("x", "y", "z", "roll", "pitch", "yaw"),
    *("vx", "vy", "vz", "vroll", "vpitch", "vyaw", "ax", "ay", "az"),
)
WHEELS = kinematics({"wheel_radii": None, "track": None, "steering_distance": None})


def load(name: str) -> Any:
    return yaml.safe_load((ROOT / "config" / name).read_text())


def test_the_filter_fuses_velocities_and_the_gyro() -> None:
    """The EKF fuses only the velocities from odometry and the yaw rate of the gyro.

    The board computes its yaw from the same gyro, so this yaw is not fused.
    """
    ekf = load("ekf_fejemis.yaml")["/**"]["ros__parameters"]
    fused = {
        sensor: {s for s, used in zip(STATES, ekf[f"{sensor}_config"], strict=True) if used}
        for sensor in ("odom0", "imu0")
    }
    assert fused == {"odom0": {"vx", "vy", "vyaw"}, "imu0": {"vyaw"}}
    assert (ekf["odom0"], ekf["imu0"]) == ("odom", "imu/data_raw")
    assert (ekf["two_d_mode"], ekf["publish_tf"]) == (True, True)
    assert ekf["odom_frame"] == PARAMETERS.by_name["odom_frame"].default
    assert ekf["base_link_frame"] == PARAMETERS.by_name["base_frame"].default


def test_nav2_plans_and_follows_curves_forward() -> None:
    """Nav2's planner and controller have the same turning radius.

    Their speed limits are those of the driver.
    """
    file = load("nav2_fejemis.yaml")
    mppi = file["controller_server"]["ros__parameters"]["FollowPath"]
    planner = file["planner_server"]["ros__parameters"]["GridBased"]
    assert mppi["motion_model"] == "Ackermann"
    radius_m = mppi["AckermannConstraints"]["min_turning_r"]
    assert radius_m == planner["minimum_turning_radius"]
    assert planner["motion_model_for_search"] == "DUBIN"
    assert (mppi["vx_max"], mppi["vx_min"], mppi["vy_max"]) == (LINEAR, 0.0, 0.0)
    assert mppi["wz_max"] == ANGULAR
    assert {name for name in mppi if name.endswith("Critic")} == set(mppi["critics"])
    smoother = file["velocity_smoother"]["ros__parameters"]
    assert smoother["max_velocity"] == [LINEAR, 0.0, ANGULAR]
    assert smoother["min_velocity"] == [0.0, 0.0, -ANGULAR]
    assert smoother["velocity_timeout"] == TIMEOUT


def description() -> Any:
    document = xacro.process_file(str(ROOT / "urdf/fejemis.urdf.xacro"))
    return URDF.from_xml_string(document.toxml())


def test_the_description_has_every_joint_and_frame_of_the_driver() -> None:
    """The robot description (URDF) has the driver's joints and frames.

    The steering axis points up.
    """
    robot = description()
    assert robot.get_root() == PARAMETERS.by_name["base_frame"].default
    turning = [joint.name for joint in robot.joints if joint.type != "fixed"]
    assert turning == [*WHEELS.joints, WHEELS.steering_joint]
    assert robot.joint_map[WHEELS.steering_joint].axis == [0, 0, 1]
    frames = {f"range_{name}_link" for name in RANGES} | {PARAMETERS.by_name["imu_frame"].default}
    assert frames < set(robot.link_map)


def test_the_description_has_the_drivers_sizes() -> None:
    """Track width and wheelbase in the robot description (URDF) are the driver's defaults."""
    joints = description().joint_map
    left, right = (joints[name].origin.xyz for name in WHEELS.joints)
    assert left[1] - right[1] == WHEELS.track_m
    assert joints[WHEELS.steering_joint].origin.xyz[0] == WHEELS.wheelbase_m


def test_nav2_has_the_footprint_of_the_description() -> None:
    """Both costmaps of Nav2 have the same footprint.

    It encloses the wheels of the robot description (URDF).
    """
    file = load("nav2_fejemis.yaml")
    maps = [file[name][name]["ros__parameters"] for name in ("local_costmap", "global_costmap")]
    assert maps[0]["footprint"] == maps[1]["footprint"]
    corners = yaml.safe_load(maps[0]["footprint"])
    assert WHEELS.track_m / 2 + 0.02 <= max(y for _, y in corners) < 0.3
    assert max(x for x, _ in corners) > WHEELS.wheelbase_m + 0.06
