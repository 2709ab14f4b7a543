# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of joint states, diagnostics, transforms and the gyro calibration, over real DDS."""

import importlib.util
import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
import yaml
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from driver_process import PATIENCE_S, Driver
from nav_msgs.msg import Odometry
from probe import Probe
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float32MultiArray
from std_srvs.srv import SetBool, Trigger

from omnibot_driver.simulator.omnibot import BoardSettings, PtyBoard, SimulatedBoard

PLANTED_DPS = (1.5, -2.0, 3.0)
HAS_TF2 = importlib.util.find_spec("tf2_ros") is not None


class Robot:
    """A board and a driver that all tests of this module share.

    At the end of each test the robot rests.
    """

    def __init__(self, stack: ExitStack, folder: Path) -> None:
        self.file = folder / "calibration.yaml"
        self.file.write_text("robot: no. 7\n")
        settings = BoardSettings(gyro_bias_dps=PLANTED_DPS)
        self.board = stack.enter_context(PtyBoard(SimulatedBoard(settings)))
        self.driver = stack.enter_context(
            Driver(
                port=self.board.path,
                frame_prefix="robot1/",
                calibration_file=self.file,
                use_sim_time=False,
            )
        )
        self.probe = stack.enter_context(Probe.of(self.driver))
        self.probe.wait_for_state("nominal")
        self.reports = self.probe.listen(DiagnosticArray, "/diagnostics")

    def status(self, name: str) -> Any:
        """Return this robot's newest diagnostic status with this name, or None."""
        found = [
            status
            for report in self.reports
            for status in report.status
            if status.hardware_id == self.board.path and status.name == f"omnibot_driver: {name}"
        ]
        return found[-1] if found else None

    def has_level(self, name: str, level: bytes) -> bool:
        """Return whether the newest diagnostic status of this name has this level."""
        status = self.status(name)
        return status is not None and status.level == level


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Robot]:
    with ExitStack() as stack:
        yield Robot(stack, tmp_path_factory.mktemp("calibration"))


def test_the_gyro_is_calibrated_saved_and_loaded_again(
    robot: Robot, start_driver: Callable[..., Driver], probe_of: Callable[[Driver], Probe]
) -> None:
    """``~/calibrate_gyro`` reports the simulated gyro's bias and saves it in the calibration file.

    Another driver then loads the bias from this file.
    """
    planted = [math.radians(value) for value in PLANTED_DPS]
    answer = robot.probe.call(Trigger, "calibrate_gyro")
    assert answer.success, answer.message
    assert "noise" in answer.message
    assert answer.message.endswith(f"saved to {robot.file}")
    saved = yaml.safe_load(robot.file.read_text())
    assert saved["robot"] == "no. 7"
    assert saved["gyro_bias"] == pytest.approx(planted, abs=5e-4)
    imu = robot.probe.listen(Imu, "imu/data_raw")
    robot.probe.wait_for(lambda: len(imu) >= 100)
    mean = sum(message.angular_velocity.z for message in imu) / len(imu)
    assert mean == pytest.approx(0.0, abs=1e-3)

    second = start_driver("/dev/null", calibration_file=robot.file)
    values = probe_of(second).call(GetParameters, "get_parameters", names=["gyro_bias"]).values
    assert list(values[0].double_array_value) == saved["gyro_bias"]


def test_a_calibration_that_cannot_be_saved_is_applied_and_says_so(robot: Robot) -> None:
    """The calibration file is damaged. A new gyro bias is applied, but not saved."""
    robot.file.write_text("gyro_bias: [1, 2")
    answer = robot.probe.call(Trigger, "calibrate_gyro")
    assert not answer.success
    assert answer.message.startswith("gyro bias (0.0")
    assert "it is applied, but not saved" in answer.message
    assert "correct the file" in answer.message
    assert robot.file.read_text() == "gyro_bias: [1, 2"


def test_a_calibration_file_that_makes_no_sense_ends_the_driver(
    tmp_path: Path, start_driver: Callable[..., Driver]
) -> None:
    """The calibration file is damaged. The driver says what to do and exits with code 2."""
    path = tmp_path / "robot.yaml"
    path.write_text("gyro_bias: [1, 2")
    driver = start_driver("/dev/null", calibration_file=path)
    driver.wait_for_line("calibration_file.*correct the file or the path, or remove")
    assert driver.end() == 2


def test_the_bias_is_what_was_set_last(
    start_board: Callable[..., PtyBoard], start_driver: Callable[..., Driver], probe_of: Any
) -> None:
    """A ``gyro_bias`` that a user sets replaces the bias that the driver has refined.

    This also holds if the user's value is the same as the previous value of the parameter.
    """
    board = start_board(gyro_bias_dps=PLANTED_DPS, running=True)
    probe: Probe = probe_of(start_driver(board.path, auto_gyro_bias=True))
    imu = probe.listen(Imu, "imu/data_raw")

    def rate() -> float:
        """Return the mean yaw rate in the last 20 IMU messages, divided by the simulated bias."""
        mean = sum(message.angular_velocity.z for message in imu[-20:]) / 20
        return mean / math.radians(PLANTED_DPS[2])

    probe.wait_for(lambda: len(imu) > 20 and rate() < 0.8)
    now = {"auto_gyro_bias": False, "gyro_bias": [0.0, 0.0, 0.0]}
    parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in now.items()]
    probe.call(SetParameters, "set_parameters", parameters=parameters)
    probe.wait_for(lambda: rate() > 0.95)


def test_the_wheels_turn_as_they_are_told(robot: Robot) -> None:
    """A user sends wheel_cmd. The wheels in joint_states turn at the commanded rates.

    Their order, signs and units are those of the command.
    """
    joints = robot.probe.listen(JointState, "joint_states")
    commands = robot.probe.publisher(Float32MultiArray, "wheel_cmd")
    wanted = [4.0, -2.0, 1.0]

    def drive() -> bool:
        commands.publish(Float32MultiArray(data=wanted))
        return bool(joints) and list(joints[-1].velocity) == pytest.approx(wanted, abs=0.6)

    robot.probe.wait_for(lambda: drive() and joints[-1].position[0] - joints[0].position[0] > 4.0)
    assert list(joints[-1].name) == ["wheel_a_joint", "wheel_b_joint", "wheel_c_joint"]
    turned = [b - a for a, b in zip(joints[0].position, joints[-1].position, strict=True)]
    ratio = turned[1] / turned[0]
    assert ratio == pytest.approx(-0.5, abs=0.1)
    on = robot.probe.node.create_timer(
        0.05, lambda: commands.publish(Float32MultiArray(data=wanted))
    )
    refused = robot.probe.call(Trigger, "calibrate_gyro")
    assert not refused.success
    robot.probe.remove(on)
    robot.probe.call(SetBool, "estop", data=True)
    robot.probe.wait_for(lambda: robot.has_level("E-stop", b"\x01"))
    assert "~/estop" in robot.status("E-stop").message
    robot.probe.call(SetBool, "estop", data=False)
    assert robot.board.wait_for(lambda b: max(map(abs, b.rim_speeds_mps)) < 0.01, PATIENCE_S)


def test_diagnostics_come_with_figures(robot: Robot) -> None:
    """The diagnostics have seven statuses, show the expected IMU rate, and count no faults."""

    def keeps_pace() -> bool:
        """Return whether the IMU rate is right. After a stall, it is wrong for a while."""
        if (status := robot.status("Stream")) is None:
            return False
        values = {value.key: value.value for value in status.values}
        rate, _, wanted = values["IMU rate (Hz)"].partition(" of ")
        return float(rate) == pytest.approx(float(wanted), rel=0.2)

    robot.probe.wait_for(keeps_pace)
    ours = [one for one in robot.reports if one.status[0].hardware_id == robot.board.path]
    assert len(ours[-1].status) == 7
    link = {value.key: value.value for value in robot.status("Link").values}
    assert link["Connected"] == "yes"
    assert int(link["Bytes received"]) > 1000
    stream = {value.key: value.value for value in robot.status("Stream").values}
    assert stream["Framing faults"] == stream["Sequence gaps"] == "0"


def test_the_updater_publishes_where_it_is_installed(robot: Robot) -> None:
    """Where diagnostic_updater is installed, it publishes the driver's diagnostics."""
    pytest.importorskip("diagnostic_updater", exc_type=ImportError)
    period = ["diagnostic_updater.period"]
    values = robot.probe.call(GetParameters, "get_parameters", names=period).values
    assert values[0].double_value == 1.0
    robot.probe.wait_for(lambda: robot.status("Link"))
    assert robot.status("Link").level == b"\x00"


def test_every_frame_is_prefixed_and_missing_tf_is_told_once(robot: Robot) -> None:
    """Frame names in odom begin with ``frame_prefix``. A missing tf2_ros is reported once."""
    odometry = robot.probe.listen(Odometry, "odom")
    robot.probe.wait_for(lambda: odometry)
    assert odometry[-1].header.frame_id == "robot1/odom"
    assert odometry[-1].child_frame_id == "robot1/base_link"
    told = [line for line in robot.driver.lines if "tf2_ros is not installed" in line]
    assert len(told) == (0 if HAS_TF2 else 1)
    assert all("WARN" in line for line in told)


def test_a_prefix_without_its_slash_is_told_at_the_start(
    start_driver: Callable[..., Driver],
) -> None:
    """The driver warns at its start if the user's ``frame_prefix`` does not end with a slash.

    The warning shows a resulting frame name, ``robot1odom``.
    """
    driver = start_driver("/dev/null", publish_tf=False, frame_prefix="robot1")
    driver.wait_for_line("frame_prefix 'robot1' does not end with a slash")


def test_who_does_not_want_transforms_hears_nothing_of_tf(
    start_driver: Callable[..., Driver],
) -> None:
    """If ``publish_tf`` is false, the driver does not warn that tf2_ros is missing.

    It still gives other warnings, for example about simulated time on a real port.
    """
    driver = start_driver("/dev/null", publish_tf=False, use_sim_time=True)
    driver.wait_for_line("use_sim_time is set, but the board on /dev/null runs in real time")
    assert "tf2" not in driver.output


def test_measurements_wait_for_simulated_time_and_it_is_said(
    start_driver: Callable[..., Driver], probe_of: Callable[[Driver], Probe]
) -> None:
    """With ``use_sim_time``, the driver publishes measurements only when /clock has a time.

    This also holds for a simulated board, which runs in real time.
    """
    driver = start_driver("sim://", use_sim_time=True)
    probe = probe_of(driver)
    imu = probe.listen(Imu, "imu/data_raw")
    probe.wait_for_graph(lambda: probe.node.count_publishers("imu/data_raw"))
    probe.wait_for_state("nominal")
    driver.wait_for_line("use_sim_time is set but nothing publishes /clock")
    assert not imu
    clock = probe.publisher(Clock, "/clock")
    probe.node.create_timer(0.1, lambda: clock.publish(Clock(clock=Time(sec=1000))))
    probe.wait_for(lambda: len(imu) > 20)
    stamps_s = [
        message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec for message in list(imu)
    ]
    assert stamps_s == pytest.approx([1000.0] * len(stamps_s), abs=PATIENCE_S)


def test_the_transform_follows_odom(robot: Robot) -> None:
    """Stamps, frames and poses on /tf equal those of odom."""
    tf2_msgs = pytest.importorskip("tf2_msgs.msg", exc_type=ImportError)
    pytest.importorskip("tf2_ros", exc_type=ImportError)
    transforms = robot.probe.listen(tf2_msgs.TFMessage, "/tf")
    odometry = robot.probe.listen(Odometry, "odom")

    def pairs() -> list[tuple[Any, Any]]:
        found = [t for message in list(transforms) for t in message.transforms]
        return [
            (t, o)
            for t in found
            for o in list(odometry)
            if t.header == o.header and t.child_frame_id == o.child_frame_id
        ]

    robot.probe.wait_for(lambda: len(pairs()) >= 5)
    for transform, pose in pairs():
        assert transform.transform.translation.x == pose.pose.pose.position.x
        assert transform.transform.rotation == pose.pose.pose.orientation
