# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the configuration of Nav2 and of the EKF for the LOIS ECU."""

from pathlib import Path
from typing import Any

import yaml

from omnibot_driver.boards.lois_ecu import PARAMETERS

CONFIG = Path(__file__).parents[3] / "config"
LINEAR, ANGULAR, TIMEOUT = (
    PARAMETERS.by_name[name].default
    for name in ("max_linear_speed", "max_angular_speed", "cmd_vel_timeout")
)
STATES = (
    *("x", "y", "z", "roll", "pitch", "yaw"),
    *("vx", "vy", "vz", "vroll", "vpitch", "vyaw", "ax", "ay", "az"),
)


def load(name: str) -> Any:
    return yaml.safe_load((CONFIG / name).read_text())


def test_the_filter_fuses_velocities_and_the_heading() -> None:
    """The EKF fuses the velocities, and the heading relative to its first value.

    It does not fuse the pose from the wheels.
    """
    ekf = load("ekf_lois_ecu.yaml")["/**"]["ros__parameters"]
    fused = {
        sensor: {s for s, used in zip(STATES, ekf[f"{sensor}_config"], strict=True) if used}
        for sensor in ("odom0", "imu0")
    }
    assert fused == {"odom0": {"vx", "vy", "vyaw"}, "imu0": {"yaw"}}
    assert (ekf["odom0"], ekf["imu0"]) == ("odom", "imu/heading")
    assert ekf["imu0_relative"] is True
    assert (ekf["two_d_mode"], ekf["publish_tf"]) == (True, True)
    assert ekf["odom_frame"] == PARAMETERS.by_name["odom_frame"].default
    assert ekf["base_link_frame"] == PARAMETERS.by_name["base_frame"].default


def test_nav2_keeps_to_the_drivers_limits_and_does_not_move_sideways() -> None:
    """Each speed limit in Nav2 is the driver's default limit. Sideways speeds are zero."""
    file = load("nav2_lois_ecu.yaml")
    mppi = file["controller_server"]["ros__parameters"]["FollowPath"]
    assert mppi["motion_model"] == "DiffDrive"
    assert (mppi["vx_max"], mppi["vx_min"], mppi["vy_max"]) == (LINEAR, 0.0, 0.0)
    assert mppi["wz_max"] == ANGULAR
    assert {name for name in mppi if name.endswith("Critic")} == set(mppi["critics"])
    smoother = file["velocity_smoother"]["ros__parameters"]
    assert smoother["max_velocity"] == [LINEAR, 0.0, ANGULAR]
    assert smoother["min_velocity"] == [-LINEAR, 0.0, -ANGULAR]
    assert smoother["max_accel"][1] == smoother["max_decel"][1] == 0.0
    assert smoother["velocity_timeout"] == TIMEOUT
    assert file["behavior_server"]["ros__parameters"]["max_rotational_vel"] <= ANGULAR
    model = file["amcl"]["ros__parameters"]["robot_model_type"]
    assert model == "nav2_amcl::DifferentialMotionModel"


def test_nav2_has_the_footprint_of_the_description() -> None:
    """Both costmaps of Nav2 have the same footprint, which is not round. It encloses the wheels."""
    file = load("nav2_lois_ecu.yaml")
    maps = [file[name][name]["ros__parameters"] for name in ("local_costmap", "global_costmap")]
    assert maps[0]["footprint"] == maps[1]["footprint"]
    corners = yaml.safe_load(maps[0]["footprint"])
    width = max(y for _, y in corners)
    assert 0.235 + 0.025 < width < 0.3
    assert not any("robot_radius" in one for one in maps)
