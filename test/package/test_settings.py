# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the files in config/ and rviz/ for other packages, for example Nav2 and RViz.

Their topics, frames and limits agree with the driver's.
"""

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rclpy
import yaml
from rclpy.context import Context
from rclpy.node import Node

from omnibot_driver import boards
from omnibot_driver.boards.omnibot import PARAMETERS

ROOT = Path(__file__).parents[2]
CONFIG = ROOT / "config"
NODE = "omnibot_driver"

FRAMES = {PARAMETERS.by_name[name].default for name in ("odom_frame", "base_frame")} | {"map"}
LINEAR, ANGULAR = (
    PARAMETERS.by_name["max_linear_speed"].default,
    PARAMETERS.by_name["max_angular_speed"].default,
)
TIMEOUT = PARAMETERS.by_name["cmd_vel_timeout"].default

# Topics of other nodes that the displays show.
OTHERS = {"robot_description", "diagnostics", "goal_pose"}


def load(name: str) -> Any:
    """Return the parsed YAML file with this name in config/."""
    return yaml.safe_load((CONFIG / name).read_text())


def parameters(name: str, node: str) -> dict[str, Any]:
    """Return the parameters of a node in a YAML file of config/."""
    found: dict[str, Any] = load(name)[node]["ros__parameters"]
    return found


def driver_names() -> set[str]:
    """Return the names of the driver's topics and services, relative to its namespace."""
    calls = [
        node
        for source in (ROOT / NODE).glob("*.py")
        for node in ast.walk(ast.parse(source.read_text()))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and node.func.attr in ("create_publisher", "create_subscription", "create_service")
    ]
    names = [call.args[1].value for call in calls if isinstance(call.args[1], ast.Constant)]
    return {str(name).replace("~", NODE, 1) for name in names}


def everything_under(key: str, tree: Any) -> Iterator[Any]:
    """Yield each value that ``key`` has anywhere in a tree of dictionaries and lists."""
    if isinstance(tree, dict):
        if key in tree:
            yield tree[key]
        for branch in tree.values():
            yield from everything_under(key, branch)
    elif isinstance(tree, list):
        for branch in tree:
            yield from everything_under(key, branch)


DRIVER = driver_names()


def test_the_drivers_names_are_found() -> None:
    """The function ``driver_names`` finds the driver's topics and services in the driver's code.

    The other tests compare the names in config/ and rviz/ with these.
    """
    assert {"odom", "imu/data_raw", "cmd_vel", f"{NODE}/estop_active", f"{NODE}/estop"} <= DRIVER


@pytest.mark.parametrize("path", sorted(CONFIG.glob("*.yaml")), ids=lambda path: path.name)
def test_ros_reads_each_parameter_file(path: Path) -> None:
    """rcl, the ROS client library, reads each parameter file.

    The parser of rcl is stricter than YAML: it accepts neither anchors nor mixed lists.
    """
    context = Context()
    rclpy.init(args=["--ros-args", "--params-file", str(path)], context=context)
    rclpy.shutdown(context=context)


@pytest.mark.parametrize("board", boards.PROFILES)
def test_yaml_reads_the_defaults_in_each_parameter_file(board: str) -> None:
    """Python's YAML parser reads each default in a parameter file with the right type.

    A file must not have a number such as 1e-06: this parser reads it as a string.
    """
    rows = boards.load(board).PARAMETERS.by_name
    values = load(f"{board}.yaml")["/**"]["ros__parameters"]
    assert values == {name: rows[name].default for name in values}


def test_the_filter_fuses_the_drivers_velocities_and_gyro() -> None:
    """The EKF fuses velocities from odom, and the yaw rate from odom and the IMU.

    The EKF publishes TF.
    """
    ekf = parameters("ekf.yaml", "/**")
    states = [
        *("x", "y", "z", "roll", "pitch", "yaw"),
        *("vx", "vy", "vz", "vroll", "vpitch", "vyaw", "ax", "ay", "az"),
    ]
    fused = {
        sensor: {s for s, used in zip(states, ekf[f"{sensor}_config"], strict=True) if used}
        for sensor in ("odom0", "imu0")
    }
    assert fused == {"odom0": {"vx", "vy", "vyaw"}, "imu0": {"vyaw"}}
    assert {ekf["odom0"], ekf["imu0"]} == {"odom", "imu/data_raw"} <= DRIVER
    assert {ekf[f"{name}_frame"] for name in ("map", "odom", "base_link", "world")} == FRAMES
    assert ekf["two_d_mode"] is True
    assert ekf["publish_tf"] is True


def test_nav2_keeps_to_the_drivers_limits() -> None:
    """Each speed limit in Nav2 is the driver's default limit, so the robot can follow the plans."""
    file = load("nav2_omnibot.yaml")
    mppi = file["controller_server"]["ros__parameters"]["FollowPath"]
    assert {mppi["vx_max"], -mppi["vx_min"], mppi["vy_max"]} == {LINEAR}
    assert mppi["wz_max"] == ANGULAR
    smoother = file["velocity_smoother"]["ros__parameters"]
    assert smoother["max_velocity"] == [LINEAR, LINEAR, ANGULAR]
    assert smoother["min_velocity"] == [-LINEAR, -LINEAR, -ANGULAR]
    assert file["behavior_server"]["ros__parameters"]["max_rotational_vel"] <= ANGULAR
    dock = file["docking_server"]["ros__parameters"]["controller"]
    assert dock["v_linear_max"] <= LINEAR
    assert dock["v_angular_max"] <= ANGULAR
    assert smoother["velocity_timeout"] == TIMEOUT


def test_nav2_knows_that_the_robot_moves_sideways() -> None:
    """Nav2's localization, controller and velocity thresholds are set for sideways motion."""
    file = load("nav2_omnibot.yaml")
    controller = file["controller_server"]["ros__parameters"]
    assert controller["FollowPath"]["motion_model"] == "Omni"
    assert "PreferForwardCritic" not in controller["FollowPath"]["critics"]
    assert controller["min_y_velocity_threshold"] == controller["min_x_velocity_threshold"]
    assert file["amcl"]["ros__parameters"]["robot_model_type"] == "nav2_amcl::OmniMotionModel"


def test_nav2_uses_the_drivers_topics_and_frames() -> None:
    """Nav2 uses the driver's topics for odometry and commands, and the driver's frames."""
    file = load("nav2_omnibot.yaml")
    assert set(everything_under("odom_topic", file)) == {"odom"} <= DRIVER
    assert set(everything_under("cmd_vel_out_topic", file)) == {"cmd_vel"} <= DRIVER
    keys = (
        *("global_frame", "global_frame_id", "local_frame", "odom_frame_id", "fixed_frame"),
        *("robot_base_frame", "base_frame_id", "base_frame"),
    )
    assert {frame for key in keys for frame in everything_under(key, file)} == FRAMES


@pytest.mark.parametrize("path", sorted(CONFIG.glob("nav2_*.yaml")), ids=lambda path: path.name)
def test_nav2_has_the_behaviours_of_its_default_trees(path: Path) -> None:
    """Nav2's default behaviour trees use three behaviours, so the behaviour server has all of them.

    Regression: the file for a Fejemis lacked the behaviour ``backup``, so bt_navigator could not
    load its tree, and Nav2 did not start.
    """
    server = load(path.name)["behavior_server"]["ros__parameters"]
    assert {"spin", "wait", "backup"} <= set(server["behavior_plugins"])
    assert all(server[name]["plugin"] for name in server["behavior_plugins"])


def test_every_critic_that_is_tuned_is_used() -> None:
    """Each critic of Nav2's controller that has settings is in the list of critics.

    Nav2 would ignore the settings of a critic that is not in the list.
    """
    mppi = load("nav2_omnibot.yaml")["controller_server"]["ros__parameters"]["FollowPath"]
    assert {name for name in mppi if name.endswith("Critic")} == set(mppi["critics"])


def test_the_mux_is_locked_by_the_drivers_estop() -> None:
    """The lock of twist_mux is the driver's topic ``estop_active``.

    The lock has priority over all sources.
    """
    mux = parameters("twist_mux.yaml", "/**")
    (lock,) = mux["locks"].values()
    assert lock["topic"] == f"{NODE}/estop_active"
    assert lock["topic"] in DRIVER
    assert lock["timeout"] == 0.0
    assert all(source["priority"] < lock["priority"] for source in mux["topics"].values())


def test_the_mux_passes_on_what_the_driver_takes() -> None:
    """The sources of twist_mux are topics that the driver does not use.

    Their timeout is the driver's command timeout. Their message type is the one that the driver
    expects.
    """
    mux = parameters("twist_mux.yaml", "/**")
    sources = mux["topics"].values()
    assert {source["timeout"] for source in sources} == {TIMEOUT}
    assert not DRIVER & {source["topic"] for source in sources}
    assert mux["use_stamped"] is PARAMETERS.by_name["enable_stamped_cmd_vel"].default
    assert "-r cmd_vel_out:=cmd_vel\n" in (CONFIG / "twist_mux.yaml").read_text()


@pytest.mark.parametrize("namespace", ["/", "/robot1"])
def test_the_mux_reads_its_file_in_each_namespace(namespace: str) -> None:
    """The parameter file for twist_mux applies in any namespace.

    Each robot of a fleet has its own namespace, in which its twist_mux runs. Bug: in a namespace,
    twist_mux got no parameters, so it forwarded no command.
    """
    context = Context()
    arguments = ["--params-file", str(CONFIG / "twist_mux.yaml"), "-r", f"__ns:={namespace}"]
    rclpy.init(args=["--ros-args", *arguments], context=context)
    try:
        node = Node(
            "twist_mux", context=context, automatically_declare_parameters_from_overrides=True
        )
        assert node.get_parameter("locks.estop.topic").value == f"{NODE}/estop_active"
        node.destroy_node()
    finally:
        rclpy.shutdown(context=context)


def test_rviz_shows_topics_and_frames_that_exist() -> None:
    """RViz shows topics of the driver.

    Their names are relative, so a robot's namespace can be added.
    """
    rviz = yaml.safe_load((ROOT / "rviz/omnibot.rviz").read_text())["Visualization Manager"]
    topics = {
        topic["Value"]
        for key in ("Topic", "Description Topic")
        for topic in everything_under(key, rviz)
    }
    assert {"odom", "robot_description"} < topics <= DRIVER | OTHERS
    assert rviz["Global Options"]["Fixed Frame"] == PARAMETERS.by_name["odom_frame"].default


def test_foxglove_shows_topics_and_services_that_exist() -> None:
    """Each topic or service in Foxglove's layout belongs to the driver or to a known other node."""
    text = (CONFIG / "foxglove.json").read_text()
    names = set(re.findall(r'"/([a-z_/]+)', text))
    assert {"odom", "imu/data_raw", f"{NODE}/state", f"{NODE}/estop"} < names
    assert names <= DRIVER | OTHERS


def test_foxglove_lays_out_every_panel_once() -> None:
    """Foxglove's layout shows each panel that has settings exactly once, and no other panel."""
    layout = json.loads((CONFIG / "foxglove.json").read_text())
    places = list(everything_under("first", layout)) + list(everything_under("second", layout))
    panels = [place for place in places if isinstance(place, str)]
    assert sorted(panels) == sorted(layout["configById"])


def test_foxglove_drives_slowly_and_often_enough() -> None:
    """Foxglove's buttons send speeds within the driver's limits.

    A button repeats its command more than twice within the driver's command timeout.
    """
    teleop = json.loads((CONFIG / "foxglove.json").read_text())["configById"]["Teleop!drive"]
    assert teleop["publishRate"] > 2 / TIMEOUT
    limits = {"linear-x": LINEAR, "angular-z": ANGULAR}
    for button in ("upButton", "downButton", "leftButton", "rightButton"):
        assert 0 < abs(teleop[button]["value"]) < limits[teleop[button]["field"]]
