# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the driver's parameters and arguments, at its start and while it runs."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from driver_process import PATIENCE_S, Driver
from geometry_msgs.msg import Twist
from probe import Probe
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    SetParameters,
    SetParametersAtomically,
)

from omnibot_driver.boards.omnibot import PARAMETERS
from omnibot_driver.driver import in_plain_words

Start = Callable[..., Any]


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"max_liner_speed": 0.3}, "no parameter 'max_liner_speed'.*nearest is 'max_linear_speed'"),
        ({"command_rate": 500.0}, "'command_rate' must be 1 to 50 Hz"),
        ({"cmd_vel_timeout": float("nan")}, "'cmd_vel_timeout' must be"),
        ({"on_exit": "explode"}, "'on_exit' must be one of stop, pause, reset"),
        ({"axis_signs": "[1, 2, 1]"}, "'axis_signs' must be three numbers"),
        ({"baudrate": "fast"}, "'baudrate' must be an integer, not 'fast'"),
        ({"on_exit": "off"}, "'on_exit' must be a string, not False .*put the word in quotes"),
        ({"odom_frame": "/odom"}, "leading slash"),
        ({"max_linear_speed": 3.0}, "'max_linear_speed' .* above 'fastest_linear_speed'"),
        ({"fastest_angular_speed": 0.4}, "'max_angular_speed' .* above 'fastest_angular_speed'"),
        ({"use_sim_times": True}, "no parameter 'use_sim_times'"),
        ({"use_sim_time": 5}, "cannot start.*use_sim_time"),
    ],
)
def test_wrong_parameters_end_the_start_with_a_sentence(
    start_driver: Start, parameters: dict[str, object], message: str
) -> None:
    """A parameter is wrong.

    The driver prints the reason without a traceback and exits with code 2.
    """
    driver: Driver = start_driver("/dev/null", **parameters)
    driver.wait_for_line(message)
    assert driver.end() == 2
    assert "Traceback" not in driver.output


@pytest.mark.parametrize(
    "arguments",
    [
        ["/dev/ttyUSB0"],
        ["--port", "x"],
        ["--ros-args", "-r", f"__ns:=/{'a' * 230}"],
        ["--ros-args", "-r", "__node:=bad name"],
        ["--ros-args", "--log-level", "nonsense"],
    ],
)
def test_arguments_that_are_not_understood_end_the_start(arguments: list[str]) -> None:
    """The command line has an unknown or invalid argument. The driver ends at once with code 2.

    One sentence gives the reason, without a traceback.
    """
    command = [sys.executable, "-m", "omnibot_driver.driver", *arguments]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert ended.returncode == 2
    assert "omnibot_driver cannot start: " in ended.stderr
    assert "Traceback" not in ended.stderr


@pytest.mark.parametrize(
    ("before", "words"),
    [
        ([], ["port:=sim://"]),
        (["--ros-args"], ["port:=sim://"]),
        ([], ["port:=/dev/ttyUSB1"]),  # ROS would take it for a topic's new name
        ([], ["gyro_bias:=[0.1,0.0,0.0]", "axis_signs:=[1,-1,-1]"]),
        (["--ros-args"], ["gyro_bias:=[0.1,0.0,0.0]", "axis_signs:=[1,-1,-1]"]),
    ],
)
def test_a_forgotten_p_is_told_with_what_to_write(before: list[str], words: list[str]) -> None:
    """The user forgets ``-p`` before a parameter. The message shows how to write it."""
    command = [sys.executable, "-m", "omnibot_driver.driver", *before, *words]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert ended.returncode == 2
    assert f"cannot start: unknown argument {' '.join(words)}; give parameters" in ended.stderr
    assert "give parameters like this: --ros-args -p port:=/dev/ttyUSB0;" in ended.stderr


@pytest.mark.parametrize("before", [[], ["--ros-args"]])
@pytest.mark.parametrize("word", ["cmd_vel:=x", "__ns:=/robot1"])
def test_a_forgotten_r_is_told_with_what_to_write(before: list[str], word: str) -> None:
    """The user forgets ``-r`` before a new name. The message shows how to write it."""
    command = [sys.executable, "-m", "omnibot_driver.driver", *before, word]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert ended.returncode == 2
    assert f"cannot start: unknown argument {word}; give" in ended.stderr
    assert ended.stderr.endswith("names like this: --ros-args -r __ns:=/robot1\n")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "Failed to parse ROS arguments: Couldn't parse parameter override rule: '-p port=x'."
            " Error: Expected lexeme type (22) not found, search ended at index 4, at"
            " /src/rcl/lexer_lookahead.c:239, at /src/rcl/arguments.c:352",
            "Couldn't parse parameter override rule: '-p port=x'; write -p NAME:=VALUE, and quote"
            " an empty text: -p \"NAME:=''\"",
        ),
        (
            "Couldn't parse params file: '--params-file a.yaml'. Error: Error opening YAML file, at"
            " ./src/parser.c:271, at ./src/rcl/arguments.c:415",
            "Couldn't parse params file: '--params-file a.yaml'. Error: Error opening YAML file;"
            " check that the file exists and is valid YAML",
        ),
        ("failed to create a node", "failed to create a node"),
    ],
)
def test_an_error_text_of_ros_is_shortened_and_says_what_to_do(text: str, words: str) -> None:
    """ROS reports a wrong argument with source lines and terms of its parser.

    The driver shortens this text and adds what to do.
    """
    assert in_plain_words(text) == words


@pytest.mark.parametrize(
    ("arguments", "remedy"),
    [
        (["-p", "port=sim"], "; write -p NAME:=VALUE"),
        (["-p", "port:="], "; write -p NAME:=VALUE"),
        (["-r", "__ns:=robot1"], "; write -r NAME:=VALUE, such as -r __ns:=/robot1"),
        (["--params-file", "no-such-file.yaml"], "; check that the file exists"),
    ],
)
def test_an_argument_that_ros_rejects_is_told_with_the_remedy(
    arguments: list[str], remedy: str
) -> None:
    """The user gives an argument that ROS rejects. The driver's message says what to write.

    The test uses the error texts of the installed ROS.
    """
    command = [sys.executable, "-m", "omnibot_driver.driver", "--ros-args", *arguments]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert ended.returncode == 2
    assert remedy in ended.stderr
    assert ", at " not in ended.stderr
    assert "lexeme" not in ended.stderr


WITHOUT_ROS = """
import runpy, sys
sys.modules["rclpy"] = sys.modules["serial"] = None
runpy.run_module("omnibot_driver.driver", run_name="__main__")
"""


@pytest.mark.parametrize("arguments", [["-h"], ["--help"], ["--ros-args", "-p", "x:=1", "--help"]])
def test_help_tells_how_parameters_are_given(arguments: list[str]) -> None:
    """``--help`` explains how to give parameters.

    This option also works without rclpy and pyserial. Its exit code is 0.
    """
    command = [sys.executable, "-c", WITHOUT_ROS, *arguments]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert ended.stdout.startswith("usage: ros2 run omnibot_driver driver ")
    assert "--ros-args -p port:=/dev/ttyUSB0\n" in ended.stdout
    assert "config/<board>.yaml" in ended.stdout


def test_help_that_is_not_read_to_its_end_is_not_an_error() -> None:
    """The reader of ``--help`` is gone, for example a closed pager. The exit code is still 0."""
    reading, writing = os.pipe()
    os.close(reading)
    command = [sys.executable, "-c", WITHOUT_ROS, "--help"]
    ended = subprocess.run(command, stdout=writing, stderr=subprocess.PIPE, check=False)
    os.close(writing)
    assert (ended.returncode, ended.stderr) == (0, b"")


OPENS_NOTHING = "import serial; serial.serial_for_url = lambda *_, **__: open('/')"
"""Code that keeps the driver from opening a port. A real robot may be on the default port."""


@pytest.mark.parametrize(
    ("first_line", "said", "told"),
    [("/other/omnibot_driver", "for this node,", 1), ("/**", "/dev/null is not", 0)],
)
def test_a_parameter_file_for_another_node_is_told(
    start_driver: Start, tmp_path: Path, first_line: str, said: str, told: int
) -> None:
    """A parameter file is for another node.

    ROS ignores it without a message, but the driver reports it.
    """
    path = tmp_path / "driver.yaml"
    path.write_text(f"{first_line}:\n  ros__parameters:\n    port: /dev/null\n")
    driver: Driver = start_driver(None, before=OPENS_NOTHING, more=["--params-file", str(path)])
    driver.wait_for_line(said)
    assert driver.end(signal.SIGINT) == 0
    sentence = f"for this node, /{driver.namespace}/omnibot_driver; begin the file with /**:"
    assert driver.output.count(sentence) == told


def test_integers_are_taken_for_real_numbers(start_board: Start, start_driver: Start) -> None:
    """The driver accepts an integer for a parameter of type double: ``max_linear_speed: 1``."""
    board = start_board()
    driver: Driver = start_driver(board.path, max_linear_speed=1)
    driver.wait_for_line("state: nominal")


def set_parameter(probe: Probe, name: str, value: ParameterValue) -> Any:
    request = [Parameter(name=name, value=value)]
    return probe.call(SetParameters, "set_parameters", parameters=request).results[0]


def real(value: float) -> ParameterValue:
    return ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)


def test_tuning_changes_while_running_and_identity_does_not(
    start_board: Start, start_driver: Start, probe_of: Start
) -> None:
    """A user changes ``linear_scale``, and the next command uses the new value.

    The parameter ``port`` cannot be changed, and values out of range are rejected.
    """
    board = start_board()
    probe: Probe = probe_of(start_driver(board.path))
    probe.wait_for_state("nominal")
    assert set_parameter(probe, "linear_scale", real(100.0)).successful
    whole = ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=1)
    assert set_parameter(probe, "cmd_vel_timeout", whole).successful
    twist = Twist()
    twist.linear.x = 0.3
    probe.publisher(Twist, "cmd_vel").publish(twist)
    assert board.wait_for(lambda b: (30, 0, 0) in [c.values for c in b.commands], PATIENCE_S)
    text = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value="/dev/ttyUSB1")
    assert "read-only" in set_parameter(probe, "port", text).reason
    for value in (0.0, -1.0, float("nan"), 1e9):
        result = set_parameter(probe, "linear_scale", real(value))
        assert not result.successful
    result = set_parameter(probe, "linear_scale", text)
    assert not result.successful
    assert "linear_scale" in result.reason


def test_a_parameter_of_type_double_stays_a_double(start_driver: Start, probe_of: Start) -> None:
    """A client sets 1 instead of 1.0. Clients that ask for a double afterwards still get one."""
    probe: Probe = probe_of(start_driver("sim://"))
    probe.wait_for_state("nominal")
    whole = ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=1)
    assert set_parameter(probe, "cmd_vel_timeout", whole).successful
    names = ["cmd_vel_timeout"]
    (value,) = probe.call(GetParameters, "get_parameters", names=names).values
    assert value == real(1.0)


def test_setting_no_parameters_at_once_succeeds(start_driver: Start, probe_of: Start) -> None:
    """A client sets an empty list of parameters. Nothing is wrong, and nothing changes."""
    probe: Probe = probe_of(start_driver("sim://"))
    probe.wait_for_state("nominal")
    result = probe.call(SetParametersAtomically, "set_parameters_atomically", parameters=[]).result
    assert (result.successful, result.reason) == (True, "")


def test_what_is_no_parameter_is_refused_while_running_and_the_driver_goes_on(
    start_driver: Start, probe_of: Start
) -> None:
    """Unknown parameters, those of other boards and values of unknown types are refused.

    The refusal gives a reason.

    Regression: a value of an unknown type raised an exception in rclpy, which ended the driver.
    """
    driver: Driver = start_driver("sim://")
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    for name, kind, message in (
        ("lineer_scale", ParameterType.PARAMETER_DOUBLE, "the nearest is 'linear_scale'"),
        ("dock_distance", ParameterType.PARAMETER_DOUBLE, "belongs to board mart, not to omnibot"),
        ("linear_scale", 99, "no type that ROS knows"),
    ):
        value = ParameterValue(type=kind, double_value=1.0)
        assert message in set_parameter(probe, name, value).reason
        wrong = [
            Parameter(name="linear_scale", value=real(80.0)),
            Parameter(name=name, value=value),
        ]
        result = probe.call(
            SetParametersAtomically, "set_parameters_atomically", parameters=wrong
        ).result
        assert not result.successful
        assert message in result.reason
        assert set_parameter(probe, "linear_scale", real(100.0)).successful


def test_the_command_that_is_repeated_is_said_in_a_new_scale(
    start_board: Start, start_driver: Start, probe_of: Start
) -> None:
    """A user changes ``linear_scale`` while the driver repeats a command.

    The repetition uses the new value.
    """
    board = start_board()
    probe: Probe = probe_of(start_driver(board.path, cmd_vel_timeout=10.0))
    probe.wait_for_state("nominal")
    commands = probe.publisher(Twist, "cmd_vel")
    twist = Twist()
    twist.linear.x = 0.3
    for _ in range(20):  # a stall of the computer stops the robot
        assert set_parameter(probe, "linear_scale", real(70.0)).successful
        commands.publish(twist)
        if not board.wait_for(lambda b: b.commands[-1].values == (21, 0, 0), 1.0):
            continue
        assert set_parameter(probe, "linear_scale", real(100.0)).successful
        if board.wait_for(lambda b: b.commands[-1].values == (30, 0, 0), 1.0):
            return
    raise AssertionError("the command is not repeated in the new scale")


def test_every_parameter_is_described(
    start_board: Start, start_driver: Start, probe_of: Start
) -> None:
    """Every parameter has a description with its unit. A parameter with limits also has a range."""
    probe: Probe = probe_of(start_driver(start_board().path))
    names = [parameter.name for parameter in PARAMETERS.rows]
    descriptors = probe.call(DescribeParameters, "describe_parameters", names=names).descriptors
    for parameter, descriptor in zip(PARAMETERS.rows, descriptors, strict=True):
        assert parameter.description in descriptor.description
        assert parameter.unit in descriptor.description
        assert descriptor.read_only == parameter.fixed
        if parameter.low is not None:
            (span,) = [*descriptor.floating_point_range, *descriptor.integer_range]
            assert (span.from_value, span.to_value) == (parameter.low, parameter.high)


def test_a_speed_that_odometry_takes_as_impossible_is_refused_while_running(
    start_board: Start, start_driver: Start, probe_of: Start
) -> None:
    """A user sets ``fastest_linear_speed``, a limit of odometry, below ``max_linear_speed``.

    The driver refuses this. It also refuses a ``max_angular_speed`` above
    ``fastest_angular_speed``. A request that raises both linear speeds together is accepted.
    """
    board = start_board()
    probe: Probe = probe_of(start_driver(board.path))
    refused = set_parameter(probe, "max_angular_speed", real(9.0))
    assert not refused.successful
    assert (
        "'max_angular_speed' (9 rad/s) must not be above 'fastest_angular_speed'" in refused.reason
    )
    refused = set_parameter(probe, "fastest_linear_speed", real(0.2))
    assert not refused.successful
    assert "'max_linear_speed' (0.5 m/s) must not be above 'fastest_linear_speed'" in refused.reason
    assert set_parameter(probe, "max_linear_speed", real(0.2)).successful
    assert set_parameter(probe, "fastest_linear_speed", real(0.2)).successful
    both = [
        Parameter(name="max_linear_speed", value=real(0.6)),
        Parameter(name="fastest_linear_speed", value=real(0.7)),
    ]
    answer = probe.call(SetParametersAtomically, "set_parameters_atomically", parameters=both)
    assert answer.result.successful
