# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the launch files: what they start, and with which arguments and parameters.

Where launch is not installed, the tests that run a launch file are skipped.
"""

import ast
import json
import os
import runpy
import subprocess
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
import yaml

from omnibot_driver import boards
from omnibot_driver.boards.omnibot import PARAMETERS

ROOT = Path(__file__).parents[2]
PACKAGE = "omnibot_driver"
LAUNCH_FILES = sorted((ROOT / "launch").glob("*.py"))
INSTALLED = ("config", "launch", "rviz", "urdf")

needs_launch = pytest.mark.skipif(
    not (find_spec("launch") and find_spec("launch_ros")),
    reason="launch or launch_ros is not installed",
)

# This program replaces every executable, and records the arguments and the parameter files.
RECORDER = f"""#!{sys.executable}
import json, os, pathlib, sys
arguments = sys.argv[1:]
files = [pathlib.Path(arguments[i + 1]).read_text()
         for i, word in enumerate(arguments) if word == "--params-file"]
name = pathlib.Path(sys.argv[0]).name
record = pathlib.Path(os.environ["RECORDS"], name + ".json")
record.write_text(json.dumps({{"arguments": arguments, "files": files}}))
if name == "xacro":
    print("<robot name='expanded'/>")
"""

LAUNCHER = """
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
path, *arguments = sys.argv[1:]
service = LaunchService()
service.include_launch_description(LaunchDescription([IncludeLaunchDescription(
    PythonLaunchDescriptionSource(path),
    launch_arguments=[argument.split(":=", 1) for argument in arguments],
)]))
sys.exit(service.run())
"""

Started = dict[str, dict[str, Any]]


@pytest.fixture
def launch(tmp_path: Path) -> Callable[..., Started]:
    """Return a function that launches a file with recorders instead of the real executables.

    The function returns the arguments and parameter files that each executable received.
    """
    executables = {
        PACKAGE: "driver",
        "robot_state_publisher": "robot_state_publisher",
        "robot_localization": "ekf_node",
        "rviz2": "rviz2",
    }
    index = tmp_path / "share/ament_index/resource_index/packages"
    index.mkdir(parents=True)
    for package, executable in {**executables, "": "xacro"}.items():
        folder = tmp_path / "lib" / package if package else tmp_path / "bin"
        folder.mkdir(parents=True)
        (folder / executable).write_text(RECORDER)
        (folder / executable).chmod(0o755)
        if package:
            (index / package).touch()
    share = tmp_path / "share" / PACKAGE
    share.mkdir()
    for folder_name in INSTALLED:
        (share / folder_name).symlink_to(ROOT / folder_name)
    records = tmp_path / "records"
    records.mkdir()

    def start(name: str, *arguments: str) -> Started:
        environment = {
            **os.environ,
            "AMENT_PREFIX_PATH": str(tmp_path),
            "PATH": f"{tmp_path / 'bin'}:{os.environ['PATH']}",
            "RECORDS": str(records),
            "ROS_LOG_DIR": str(tmp_path / "log"),
        }
        done = subprocess.run(
            [sys.executable, "-c", LAUNCHER, str(ROOT / "launch" / name), *arguments],
            env=environment,
            capture_output=True,
            text=True,
            check=False,
            timeout=60,
        )
        assert done.returncode == 0, done.stderr
        return {path.stem: json.loads(path.read_text()) for path in records.iterdir()}

    return start


def parameters(record: dict[str, Any]) -> dict[str, Any]:
    """Return a process's parameters from all its files. Later files replace earlier values."""
    merged: dict[str, Any] = {}
    for text in record["files"]:
        for node in yaml.safe_load(text).values():
            merged.update(node["ros__parameters"])
    return merged


@pytest.mark.parametrize("path", LAUNCH_FILES, ids=lambda path: path.name)
def test_a_launch_file_names_only_what_is_installed(path: Path) -> None:
    """Each file of this package that a launch file names is in an installed folder."""
    strings = [
        node.value
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    ]
    folders = [text for text in strings if text in INSTALLED]
    names = [text.strip() for text in strings]
    names = [name for name in names if name.endswith((".py", ".yaml", ".xacro", ".rviz"))]
    assert names
    for name in names:  # a name that begins with a dot follows the board's name
        for file in [f"{board}{name}" for board in boards.PROFILES] if name[0] == "." else [name]:
            assert any((ROOT / folder / file).is_file() for folder in folders), file


def test_the_driver_has_every_parameter_that_is_offered() -> None:
    """The launch file offers only parameters that at least one board has.

    An unknown parameter would end the driver.
    """
    tree = ast.parse((ROOT / "launch/driver.launch.py").read_text())
    (offered,) = (
        [ast.literal_eval(key) for key in node.value.keys if key]
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Dict)
    )
    assert {"port"} < set(offered)
    assert all(boards.owners_of(name) for name in offered)


class Stub(ModuleType):
    """A substitute for a module of launch.

    Each name in the module is a function, which returns its name and the arguments of the call.
    """

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return lambda *words, **options: SimpleNamespace(kind=name, words=words, options=options)


@pytest.mark.parametrize(("file", "parameters_of"), [("driver", "{}.yaml"), ("ekf", "ekf_{}.yaml")])
def test_a_board_without_a_parameter_file_is_refused(
    file: str, parameters_of: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The launch file offers only boards that have a parameter file.

    For a missing file, launch would only warn, and start the node without parameters.
    """
    for module in ("launch", "launch_ros"):
        for part in (
            *("", ".actions", ".conditions", ".launch_description_sources"),
            *(".parameter_descriptions", ".substitutions"),
        ):
            monkeypatch.setitem(sys.modules, module + part, Stub(module + part))
    started = runpy.run_path(str(ROOT / f"launch/{file}.launch.py"))["generate_launch_description"]
    (argument,) = (
        action.options
        for action in started().words[0]
        if action.kind == "DeclareLaunchArgument" and action.words == ("board",)
    )
    chosen = set(argument["choices"]) - {argument["default_value"]}
    assert {"omnibot"} < chosen <= set(boards.PROFILES)
    for board in chosen - {"omnibot"}:
        assert (ROOT / "config" / parameters_of.format(board)).is_file(), board


@needs_launch
def test_the_driver_gets_the_defaults_and_nothing_else(launch: Callable[..., Started]) -> None:
    """Without launch arguments, the driver gets the values of the parameter file, unchanged."""
    started = launch("driver.launch.py")
    assert set(started) == {"driver"}
    assert parameters(started["driver"]) == {
        parameter.name: parameter.default for parameter in PARAMETERS.by_name.values()
    }


@needs_launch
def test_the_driver_gets_what_is_given(launch: Callable[..., Started]) -> None:
    """Each argument becomes a parameter of the right type. The node is in the given namespace."""
    started = launch(
        "driver.launch.py",
        *("port:=sim://", "publish_tf:=false", "frame_prefix:=robot1/", "namespace:=robot1"),
    )
    given = parameters(started["driver"])
    assert (given["port"], given["publish_tf"], given["frame_prefix"]) == (
        "sim://",
        False,
        "robot1/",
    )
    assert "__ns:=/robot1" in started["driver"]["arguments"]
    assert "__node:=omnibot_driver" in started["driver"]["arguments"]


@needs_launch
def test_the_parameter_file_is_that_of_the_board(
    launch: Callable[..., Started], tmp_path: Path
) -> None:
    """The argument ``board`` selects the board's parameter file.

    Without this argument, the user's own parameter file can select the board, if it contains the
    parameter ``board``.
    """
    defaults = {row.name: row.default for row in PARAMETERS.rows}
    assert parameters(launch("driver.launch.py", "board:=omnibot")["driver"]) == defaults
    given = parameters(launch("driver.launch.py", "board:=lois_ecu")["driver"])
    assert (given["board"], given["drive_mode"]) == ("lois_ecu", "rpm")
    own = tmp_path / "own.yaml"
    own.write_text("/**:\n  ros__parameters:\n    board: lois_ecu\n")
    for file in ("driver", "ekf"):
        started = launch(f"{file}.launch.py", f"params_file:={own}")
        assert parameters(started["driver"])["board"] == "lois_ecu"


@needs_launch
@pytest.mark.parametrize("file", ["driver", "ekf", "simulation"])
def test_a_given_board_is_obeyed_beside_a_file_that_names_none(
    launch: Callable[..., Started], tmp_path: Path, file: str
) -> None:
    """The argument ``board`` selects the board if the user's parameter file names none."""
    own = tmp_path / "own.yaml"
    own.write_text("/**:\n  ros__parameters:\n    max_linear_speed: 0.3\n")
    started = launch(f"{file}.launch.py", "board:=lois_ecu", f"params_file:={own}")
    given = parameters(started["driver"])
    assert (given["board"], given["max_linear_speed"]) == ("lois_ecu", 0.3)


@needs_launch
def test_the_description_is_expanded_and_prefixed(launch: Callable[..., Started]) -> None:
    """robot_state_publisher gets the description that xacro has expanded, and the frame prefix."""
    started = launch(
        "description.launch.py", "frame_prefix:=robot1/", "xacro_args:=base_height:=0.13"
    )
    assert set(started) == {"robot_state_publisher", "xacro"}
    path, argument = started["xacro"]["arguments"]
    assert Path(path).resolve() == ROOT / "urdf/omnibot.urdf.xacro"
    assert argument == "base_height:=0.13"
    given = parameters(started["robot_state_publisher"])
    assert given["robot_description"].strip() == "<robot name='expanded'/>"
    assert given["frame_prefix"] == "robot1/"


@needs_launch
def test_an_empty_board_is_described_as_the_default_one(launch: Callable[..., Started]) -> None:
    """A launch file that includes the driver's file may leave the argument ``board`` empty.

    The description is then that of the default board.
    """
    path, *_ = launch("description.launch.py", "board:=")["xacro"]["arguments"]
    assert Path(path).resolve() == ROOT / "urdf/omnibot.urdf.xacro"


@needs_launch
def test_rviz_is_shown_where_asked_for(launch: Callable[..., Started]) -> None:
    """The argument ``rviz`` is true.

    RViz shows this package's display in the robot's odometry frame.
    """
    started = launch("description.launch.py", "rviz:=true", "frame_prefix:=robot1/")
    words = started["rviz2"]["arguments"]
    display = Path(words[words.index("--display-config") + 1])
    assert display.resolve() == ROOT / "rviz/omnibot.rviz"
    assert words[words.index("--fixed-frame") + 1] == "robot1/odom"


@needs_launch
def test_the_filter_alone_publishes_the_transform(launch: Callable[..., Started]) -> None:
    """ekf.launch.py starts the filter, which publishes the transform from odom to base_link.

    The driver does not publish this transform. All nodes are in one namespace.
    """
    started = launch("ekf.launch.py", "namespace:=robot1", "frame_prefix:=robot1/")
    assert set(started) == {"driver", "ekf_node", "robot_state_publisher", "xacro"}
    assert parameters(started["driver"])["publish_tf"] is False
    given = parameters(started["ekf_node"])
    assert given["publish_tf"] is True
    assert (given["odom_frame"], given["base_link_frame"]) == ("robot1/odom", "robot1/base_link")
    for name in ("driver", "ekf_node", "robot_state_publisher"):
        assert "__ns:=/robot1" in started[name]["arguments"]


@needs_launch
def test_the_simulation_is_the_driver_with_a_board_inside(launch: Callable[..., Started]) -> None:
    """The simulation is one process. It accepts launch arguments for the board and the driver."""
    started = launch("simulation.launch.py", "namespace:=robot1")
    assert set(started) == {"driver"}
    assert parameters(started["driver"])["port"] == "sim://"
    assert "__ns:=/robot1" in started["driver"]["arguments"]
    started = launch("simulation.launch.py", "port:=sim://?imu_only&seed=1")
    assert parameters(started["driver"])["port"] == "sim://?imu_only&seed=1"
