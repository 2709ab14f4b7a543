# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Starting, ending, parameters and ports that are missing, busy, wrong or come late."""

import contextlib
import os
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from driver_process import Driver
from geometry_msgs.msg import Twist
from probe import Probe
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters, SetParameters
from sensor_msgs.msg import Imu
from std_msgs.msg import Bool
from std_srvs.srv import SetBool
from terminal import fill

from omnibot_driver.simulator import BoardMode, PtyBoard, SimulatedBoard

Start = Callable[..., Any]
STOP = bytes.fromhex("FF FE 02 00 00 00 00 00 00")
LAST_WORDS = bytes(8) + STOP + bytes.fromhex("FF FE 10 00 00 00 00 00 00")


def driving(probe: Probe, board: PtyBoard) -> None:
    commands = probe.publisher(Twist, "cmd_vel")
    twist = Twist()
    twist.linear.x = 0.3
    commands.publish(twist)
    assert board.wait_for(lambda b: b.commands[-1].kind == "velocity", 20.0)


@pytest.mark.parametrize(
    "signals",
    [
        [signal.SIGINT],
        [signal.SIGTERM],
        [signal.SIGINT, signal.SIGINT],
        [signal.SIGTERM, signal.SIGINT, signal.SIGINT],
        [signal.SIGHUP],
    ],
    ids=lambda signals: "+".join(number.name for number in signals),
)
def test_a_signal_while_driving_ends_with_the_stop_frame_and_exit_code_zero(
    start_board: Start, start_driver: Start, probe_of: Start, signals: list[signal.Signals]
) -> None:
    """Ctrl-C on ``ros2 launch`` arrives twice; the stop frame goes out all the same."""
    board = start_board()
    driver: Driver = start_driver(board.path)
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    driving(probe, board)
    assert driver.end(*signals) == 0
    assert "Traceback" not in driver.output
    assert board.wait_for(lambda b: bytes(b.received).endswith(STOP), 20.0)


EXPLODES = """
import omnibot_driver.node as node
def explode(self, message):
    raise ZeroDivisionError("a defect in a callback")
node.OmniBotDriver._on_estop_topic = explode
"""
SHUTS_DOWN = """
import rclpy, omnibot_driver.node as node
node.OmniBotDriver._on_estop_topic = lambda self, message: rclpy.shutdown()
"""


@pytest.mark.parametrize(("before", "exit_code"), [(EXPLODES, 1), (SHUTS_DOWN, 0)])
def test_a_defect_or_a_shutdown_of_ros_while_driving_ends_with_the_stop_frame(
    start_board: Start, start_driver: Start, probe_of: Start, before: str, exit_code: int
) -> None:
    """The exit code tells which of them it was."""
    board = start_board()
    driver: Driver = start_driver(board.path, before=before, cmd_vel_timeout=10.0)
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    driving(probe, board)
    probe.publisher(Bool, "estop").publish(Bool(data=True))
    assert driver.process.wait(20.0) == exit_code, driver.output
    assert ("a defect in a callback" in driver.output) == bool(exit_code)
    assert board.wait_for(lambda b: bytes(b.received).endswith(STOP), 20.0)


def test_a_board_that_takes_nothing_any_more_does_not_hold_up_the_end(
    start_driver: Start, probe_of: Start, silent_terminal: tuple[int, str]
) -> None:
    """The kernel's buffer is full, so the farewell does not fit in; the guard goes on trying."""
    far, path = silent_terminal
    driver: Driver = start_driver(path, auto_start=False)
    probe_of(driver).wait_for_state("connecting")
    assert os.read(far, 100).endswith(STOP)
    fill_terminal(path)
    assert driver.end(signal.SIGINT) == 0
    heard = b""
    while LAST_WORDS not in heard:
        assert select.select([far], [], [], 20.0)[0], heard
        heard += os.read(far, 4096)


def fill_terminal(path: str) -> None:
    """From the side of a program that opened it."""
    descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    fill(descriptor)
    os.close(descriptor)


@pytest.mark.parametrize(
    ("on_exit", "mode"), [("pause", BoardMode.PAUSED), ("reset", BoardMode.PAUSED)]
)
def test_the_board_can_be_left_paused_or_reset(
    start_board: Start, start_driver: Start, probe_of: Start, on_exit: str, mode: BoardMode
) -> None:
    """``on_exit``: after the stop frame, P or R."""
    board = start_board()
    driver: Driver = start_driver(board.path, on_exit=on_exit)
    probe_of(driver).wait_for_state("nominal")
    assert driver.end(signal.SIGINT) == 0
    assert board.wait_for(lambda b: b.commands[-1].kind == on_exit, 20.0)
    assert board.wait_for(lambda b: b.mode is mode, 20.0)


def test_a_missing_port_is_named_once_and_the_driver_waits_for_it(
    start_board: Start, start_driver: Start, probe_of: Start, tmp_path: Path
) -> None:
    """Plugged in later, the board is found and started without anybody's help."""
    link = tmp_path / "omnibot"
    driver: Driver = start_driver(str(link), reconnect_interval=0.05)
    driver.wait_for_line("does not exist.*by-id")
    probe: Probe = probe_of(driver)
    probe.wait_for_state("disconnected")
    start_board(link=str(link))
    probe.wait_for_state("nominal")
    assert driver.output.count("does not exist") == 1


def test_an_unplugged_board_is_found_again(
    start_board: Start, start_driver: Start, probe_of: Start, tmp_path: Path
) -> None:
    """The same node goes on with another terminal behind the same name, without a leak."""
    link = tmp_path / "omnibot"
    descriptors = []
    with PtyBoard(SimulatedBoard(), str(link)):
        driver: Driver = start_driver(str(link), reconnect_interval=0.05)
        probe: Probe = probe_of(driver)
        probe.wait_for_state("nominal")
        descriptors.append(len(os.listdir(f"/proc/{driver.process.pid}/fd")))
    probe.wait_for_state("disconnected")
    with PtyBoard(SimulatedBoard(), str(link)):
        probe.wait_for_state("nominal")
    probe.wait_for_state("disconnected")
    start_board(link=str(link))
    probe.wait_for_state("nominal")
    descriptors.append(len(os.listdir(f"/proc/{driver.process.pid}/fd")))
    assert descriptors[0] == descriptors[1]
    assert driver.output.count("lost") == 2


def test_a_second_driver_on_the_same_port_is_refused_and_told_why(
    start_board: Start, start_driver: Start
) -> None:
    """Two masters of one robot would be worse than none."""
    board = start_board()
    first: Driver = start_driver(board.path)
    first.wait_for_line("is open")
    second: Driver = start_driver(board.path)
    second.wait_for_line("in use by another program.*fuser")


@pytest.mark.parametrize(
    ("port", "reason"),
    [
        ("nonsense://board", "not understood.*socket://"),
        ("/", "check the parameter"),
        ("/dev/null", "no serial port.*by-id"),
        ("socket://nohost", "not understood.*socket://"),
        ("socket://localhost:99999", "not understood.*socket://"),
        ("socket://localhost:1", "cannot open.*refused"),
    ],
)
def test_a_port_that_cannot_be_is_explained_and_the_node_lives(
    start_driver: Start, port: str, reason: str
) -> None:
    """It goes on trying and ends like any other when asked to."""
    driver: Driver = start_driver(port)
    driver.wait_for_line(reason)
    assert driver.process.poll() is None
    assert driver.end(signal.SIGINT) == 0


def test_garbage_on_the_line_is_not_published_and_does_not_end_the_driver(
    start_driver: Start, probe_of: Start, silent_port: str, write_to_silent_port: Start
) -> None:
    """A wrong baud rate looks like this."""
    driver: Driver = start_driver(silent_port)
    probe: Probe = probe_of(driver)
    probe.wait_for_state("connecting")
    driver.wait_for_line("nothing comes from the board.*power")
    imu = probe.listen(Imu, "imu/data_raw")
    write_to_silent_port(bytes(range(256)) * 40)
    write_to_silent_port(bytes.fromhex("FF FA 00 00 00 00 40 00 00 01 00 02 00 03") * 3)
    probe.wait_for(lambda: len(imu) >= 2)
    assert [message.linear_acceleration.z for message in imu] == pytest.approx([9.80665] * len(imu))


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"max_liner_speed": 0.3}, "no parameter 'max_liner_speed'.*nearest is 'max_linear_speed'"),
        ({"command_rate": 500.0}, "'command_rate' must be 1 to 50 Hz"),
        ({"cmd_vel_timeout": float("nan")}, "'cmd_vel_timeout' must be"),
        ({"on_exit": "explode"}, "'on_exit' must be one of stop, pause, reset"),
        ({"axis_signs": "[1, 2, 1]"}, "'axis_signs' must be three numbers"),
        ({"baudrate": "fast"}, "'baudrate' must be a value of type int"),
        ({"odom_frame": "/odom"}, "leading slash"),
        ({"use_sim_times": True}, "no parameter 'use_sim_times'"),
        ({"use_sim_time": 5}, "cannot start.*use_sim_time"),
    ],
)
def test_wrong_parameters_end_the_start_with_a_sentence(
    start_driver: Start, parameters: dict[str, object], message: str
) -> None:
    """Exit code 2, no traceback."""
    driver: Driver = start_driver("/dev/null", **parameters)
    driver.wait_for_line(message)
    assert driver.process.wait(20.0) == 2
    assert "Traceback" not in driver.output


def test_integers_are_taken_for_real_numbers(start_board: Start, start_driver: Start) -> None:
    """``max_linear_speed: 1`` in a YAML file is no mistake worth refusing."""
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
    """A new scale is in the next command; another port is refused; so are values out of range."""
    board = start_board()
    probe: Probe = probe_of(start_driver(board.path))
    probe.wait_for_state("nominal")
    assert set_parameter(probe, "linear_scale", real(100.0)).successful
    whole = ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=1)
    assert set_parameter(probe, "cmd_vel_timeout", whole).successful
    driving(probe, board)
    with board.lock:
        assert (30, 0, 0) in [command.values for command in board.board.commands]
    text = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value="/dev/ttyUSB1")
    assert "read-only" in set_parameter(probe, "port", text).reason
    for value in (0.0, -1.0, float("nan"), 1e9):
        result = set_parameter(probe, "linear_scale", real(value))
        assert not result.successful
    result = set_parameter(probe, "linear_scale", text)
    assert not result.successful
    assert "linear_scale" in result.reason


def test_every_parameter_is_described(
    start_board: Start, start_driver: Start, probe_of: Start
) -> None:
    """Description, unit and range, for ``ros2 param describe`` and rqt."""
    from omnibot_driver.parameters import PARAMETERS

    probe: Probe = probe_of(start_driver(start_board().path))
    names = [parameter.name for parameter in PARAMETERS]
    descriptors = probe.call(DescribeParameters, "describe_parameters", names=names).descriptors
    for parameter, descriptor in zip(PARAMETERS, descriptors, strict=True):
        assert parameter.description in descriptor.description
        assert parameter.unit in descriptor.description
        assert descriptor.read_only == parameter.fixed
        if parameter.low is not None:
            (span,) = [*descriptor.floating_point_range, *descriptor.integer_range]
            assert (span.from_value, span.to_value) == (parameter.low, parameter.high)


@pytest.mark.parametrize(
    "arguments",
    [
        ["/dev/ttyUSB0"],
        ["--help"],
        ["--port", "x"],
        ["--ros-args", "-r", "__node:=bad name"],
        ["--ros-args", "--log-level", "nonsense"],
    ],
)
def test_arguments_that_are_not_understood_end_the_start(arguments: list[str]) -> None:
    """Ignored, they would leave the user with another port than the one that was meant."""
    command = [sys.executable, "-m", "omnibot_driver.driver", *arguments]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=20.0, check=False)
    assert ended.returncode == 2
    assert "omnibot_driver cannot start: " in ended.stderr
    assert "Traceback" not in ended.stderr


def test_a_log_that_nobody_reads_does_not_keep_the_robot_moving(start_board: Start) -> None:
    """A terminal held by ctrl-S, a hung pipe: watchdog, e-stop and SIGTERM still work."""
    board = start_board(running=True)
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    with contextlib.suppress(BlockingIOError):
        while True:
            os.write(writing, b"x" * 4096)
    os.set_blocking(writing, True)
    namespace = "unread"
    command = [sys.executable, "-m", "omnibot_driver.driver", "--ros-args"]
    command += ["-p", f"port:={board.path}", "-r", f"__ns:=/{namespace}"]
    process = subprocess.Popen(command, stdout=writing, stderr=writing)
    try:
        with Probe(namespace) as probe:
            probe.wait_for_state("nominal")
            driving(probe, board)
            bad = Twist()
            bad.linear.x = float("nan")
            probe.publisher(Twist, "cmd_vel").publish(bad)
            assert board.wait_for(lambda b: bytes(b.received).endswith(STOP), 20.0)
            assert probe.call(SetBool, "estop", data=True).success
        process.send_signal(signal.SIGTERM)
        assert process.wait(20.0) == 0
    finally:
        process.kill()
        process.wait()
        os.close(reading)
        os.close(writing)


def test_a_port_that_flaps_is_told_once(start_driver: Start) -> None:
    """A server that hangs up at once, again and again."""
    server = socket.create_server(("127.0.0.1", 0))
    port = f"socket://127.0.0.1:{server.getsockname()[1]}"
    driver: Driver = start_driver(port, reconnect_interval=0.05)
    for _ in range(8):
        peer, _ = server.accept()
        peer.close()
    server.close()
    driver.wait_for_line("cannot open.*refused")
    assert driver.output.count("is open") == 1
    assert driver.output.count("lost") <= 2
