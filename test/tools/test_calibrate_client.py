# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that a calibration finds the driver in its namespace, or explains why it cannot use one."""

import re
from dataclasses import replace
from pathlib import Path

import pytest
from calibrate_rig import Rig
from driver_process import PATIENCE_S
from std_msgs.msg import String

from omnibot_driver.boards import omnibot
from omnibot_driver.boards.omnibot import PARAMETERS
from omnibot_driver.parameters import Parameter
from omnibot_driver.tools.calibrate import client, listener
from omnibot_driver.tools.calibrate.__main__ import main
from omnibot_driver.tools.calibrate.motion import Bounds, stairs
from omnibot_driver.tools.calibrate.robot import Robot
from omnibot_driver.tools.needs import ToolError


def test_a_wrong_namespace_names_the_drivers_there_are(
    rigged: Rig, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The user gives a wrong namespace.

    The tool names the running drivers and exits with code 1.
    """
    for seconds in (4.0, 16.0, 64.0):  # on a busy computer, discovery takes longer
        monkeypatch.setattr(client, "FOUND_WITHIN_S", seconds)
        assert main(["imu", "--yes", "--namespace", "/nowhere/"]) == 1
        said = capsys.readouterr().err
        if "but these drivers" in said:
            break
    assert "no driver is running in the namespace /nowhere, but" in said
    assert f"/{rigged.driver.namespace}/omnibot_driver" in said


def test_two_drivers_in_one_namespace_move_neither(robot: Robot, rigged: Rig) -> None:
    """Two drivers have the same name. The tool sends no command, because both would obey it."""
    before = len(rigged.port.board.commands)
    twin = robot._node.create_publisher(String, f"{robot.driver}/state", listener.LATCHED)
    assert robot._wait(lambda: robot._node.count_publishers(twin.topic_name) == 2, PATIENCE_S)
    name = re.escape(robot.driver)
    with pytest.raises(ToolError, match=f"several drivers in this namespace: {name}, {name}; end"):
        robot.drive(stairs([(1.0, (0.1, 0.0, 0.0))]), Bounds(speed=0.1, way=0.5, seconds=5.0))
    assert all(one.kind != "velocity" for one in list(rigged.port.board.commands)[before:])


def test_two_drivers_are_not_taken_for_a_driver_of_another_version(robot: Robot) -> None:
    """Of two drivers with the same name, one has another board and lacks a parameter.

    The message says that there are two drivers.
    """
    twin = robot._node.create_publisher(String, f"{robot.driver}/state", listener.LATCHED)
    assert robot._wait(lambda: robot._node.count_publishers(twin.topic_name) == 2, PATIENCE_S)
    with pytest.raises(ToolError, match="several drivers in this namespace"):
        robot._get_parameters(["parameter_of_another_board"])


def test_a_driver_of_another_version_is_told(
    rigged: Rig, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The driver lacks one of the tool's parameters.

    The message reports that the driver and the tool have different versions.
    """
    newer = Parameter("of_tomorrow", 1, "", "")
    table = replace(PARAMETERS, sections={**PARAMETERS.sections, "New": (newer,)})
    monkeypatch.setattr(omnibot, "PARAMETERS", table)
    assert rigged.calibrate("scale") == 1
    assert "and this tool have different versions" in capsys.readouterr().err


def test_what_the_driver_refuses_is_told(robot: Robot) -> None:
    """The tool sets a value out of range, and the driver refuses it.

    The error names the parameter.
    """
    with pytest.raises(ToolError, match="the driver refuses linear_scale: "):
        robot.set_parameters({"linear_scale": -1.0})


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--namespace", "no/such name!"], "is not a valid namespace"),
        (["--ros-args", "--nonsense"], "the ROS arguments (after --ros-args) are invalid"),
    ],
)
def test_what_ros_cannot_take_is_a_sentence(
    words: list[str], sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The ROS arguments are invalid.

    The tool prints a message without a traceback and exits with code 1.
    """
    assert main(["imu", "--plot", str(tmp_path), *words]) == 1
    assert sentence in capsys.readouterr().err


def test_no_driver_at_all_says_how_to_start_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """No driver runs in the ROS domain. The message names the command that starts a driver."""
    monkeypatch.setattr(client, "FOUND_WITHIN_S", 0.2)
    monkeypatch.setenv("ROS_DOMAIN_ID", "101")
    assert main(["imu", "--plot", str(tmp_path)]) == 1
    assert (
        "no driver is running: start one (ros2 run omnibot_driver driver)"
        in capsys.readouterr().err
    )
