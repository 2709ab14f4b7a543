# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the driver with a simulated Fejemis on two real pseudo-terminals."""

import math
import signal
from collections.abc import Callable
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from driver_process import Driver
from fejemis_driver import driven, moves_again, robot_of, started
from nav_msgs.msg import Odometry
from probe import Probe
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from sensor_msgs.msg import BatteryState, Imu, JointState, MagneticField, Range
from std_msgs.msg import ColorRGBA, Float32
from std_srvs.srv import SetBool, Trigger
from two_ports import TwoPorts

Start = Callable[..., Any]


New = tuple[TwoPorts, Driver, Probe]


def test_it_drives_and_odometry_tells_how_far(robot: TwoPorts, probe: Probe) -> None:
    """The robot drives straight, turns, drives a curve, and stops when the commands end.

    Its pose in odom is right within 2 cm.
    """
    odometry = probe.listen(Odometry, "odom")
    joints = probe.listen(JointState, "joint_states")
    with driven(probe, robot):
        probe.wait_for(lambda: odometry and odometry[-1].pose.pose.position.x > 0.2)
    with driven(probe, robot, 0.0, 0.5):
        robot.wait_until(lambda board: board.truth.yaw_rad > 0.4)
    with driven(probe, robot, 0.3, -0.3):
        robot.wait_until(lambda board: board.truth.yaw_rad < 0.2)
    robot.stands_for_good()
    truth = robot.do(lambda board: board.truth)
    probe.wait_for_later_stamp(odometry)
    place = odometry[-1].pose.pose.position
    assert math.hypot(place.x - truth.x_m, place.y - truth.y_m) < 0.02
    stamps = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in odometry]
    assert all(after > before for before, after in pairwise(stamps))
    names = {name for message in joints for name in message.name}
    assert names == {"left_wheel_joint", "right_wheel_joint", "front_steering_joint"}
    steering = [m.position[0] for m in joints if m.name == ["front_steering_joint"]]
    assert any(angle == pytest.approx(math.pi / 2, abs=0.1) for angle in steering)


def test_its_sensors_are_published(
    stack: ExitStack, tmp_path: Path, start_driver: Start, probe_of: Start
) -> None:
    """Sensor values are published in SI units, with the frames of the robot description."""
    robot = robot_of(stack, tmp_path, front_m=1.5)
    probe: Probe = probe_of(started(robot, start_driver))
    heard = {
        topic: probe.listen(kind, topic)
        for topic, kind in (
            ("imu/data_raw", Imu),
            ("imu/data", Imu),
            ("imu/mag", MagneticField),
            ("battery_state", BatteryState),
            ("range/tof", Range),
            ("range/sonar", Range),
            ("range/ir1", Range),
            ("range/ir2", Range),
        )
    }
    probe.wait_for_state("nominal")
    probe.wait_for(lambda: all(heard.values()))
    last = {topic: messages[-1] for topic, messages in heard.items()}
    assert last["imu/data_raw"].orientation_covariance[0] == -1.0
    assert last["imu/data_raw"].linear_acceleration.z == pytest.approx(9.8, abs=0.4)
    assert last["imu/data"].orientation.w == pytest.approx(1.0, abs=0.05)
    assert last["imu/mag"].magnetic_field.x == pytest.approx(17e-6, abs=1e-6)
    assert last["battery_state"].voltage == pytest.approx(24.9, abs=0.1)
    assert last["battery_state"].current < 0.0
    assert len(last["battery_state"].cell_voltage) == 6
    assert last["range/tof"].range == pytest.approx(1.5, abs=0.01)
    assert last["range/sonar"].range == pytest.approx(1.5, abs=0.01)
    assert math.isinf(last["range/ir1"].range)
    assert last["range/ir2"].header.frame_id == "range_ir2_link"


def test_a_range_is_published_with_an_integer_that_was_set_while_it_runs(probe: Probe) -> None:
    """A user sets ``tof_maximum``, whose type is double, to 2. ``ros2 param set`` sends an integer.

    The driver accepts the integer and publishes the new maximum.
    """
    ranges = probe.listen(Range, "range/tof")
    whole = ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=2)
    changes = [Parameter(name="tof_maximum", value=whole)]
    assert probe.call(SetParameters, "set_parameters", parameters=changes).results[0].successful
    probe.wait_for(lambda: ranges and ranges[-1].max_range == 2.0)


def test_brush_lift_and_light_obey_and_the_estop_ends_brush_and_lift(
    robot: TwoPorts, probe: Probe
) -> None:
    """The user latches the e-stop while brush and lift work. The driver switches both off.

    Both stay off after the release.
    """
    lift, led = probe.publisher(Float32, "lift_cmd"), probe.publisher(ColorRGBA, "led_cmd")
    led.publish(ColorRGBA(r=1.0, g=0.5, b=0.0, a=1.0))
    robot.wait_until(lambda board: board.front.leds[5] == (255, 128, 0))
    assert probe.call(SetBool, "brush", data=True).success
    robot.wait_until(lambda board: board.vehicle.brush)
    timer = probe.node.create_timer(0.1, lambda: lift.publish(Float32(data=6.0)))
    robot.wait_until(lambda board: board.vehicle.lift.volts == 6.0)
    probe.remove(timer)
    probe.forget_message()
    robot.wait_until(lambda board: board.vehicle.lift.volts == 0.0)  # after cmd_vel_timeout
    timer = probe.node.create_timer(0.1, lambda: lift.publish(Float32(data=-8.0)))
    robot.wait_until(lambda board: -8.0 <= board.vehicle.lift.volts < -7.9)
    assert probe.call(SetBool, "estop", data=True).success
    robot.wait_until(lambda board: not board.vehicle.brush and board.vehicle.lift.volts == 0.0)
    answer = probe.call(SetBool, "brush", data=True)
    assert not answer.success
    assert "release" in answer.message
    probe.remove(timer)
    probe.forget_message()
    assert probe.call(SetBool, "estop", data=False).success
    robot.stands_for_good()
    assert not robot.do(lambda board: board.vehicle.brush or board.vehicle.lift.volts)


def test_a_lift_command_that_waited_while_the_driver_was_stalled_is_refused(
    robot: TwoPorts, driver: Driver, probe: Probe
) -> None:
    """A lift command arrives while the driver is suspended. The driver refuses it afterwards.

    The lift does not move. The base obeys the next velocity command.
    """
    before = robot.do(lambda board: board.vehicle.lift.height)
    lift = probe.publisher(Float32, "lift_cmd")
    said = len(driver.lines)
    driver.process.send_signal(signal.SIGSTOP)
    robot.stands_for_good()
    lift.publish(Float32(data=6.0))
    driver.answers.clear()  # the probe does not publish it again
    driver.process.send_signal(signal.SIGCONT)
    driver.wait_for_line("motion command refused: it waited", said)
    robot.stands_for_good()
    assert robot.do(lambda board: board.vehicle.lift.height) == before
    moves_again(probe, robot)


def test_the_estop_stops_it_until_it_is_released(robot: TwoPorts, probe: Probe) -> None:
    """The e-stop is latched while commands continue to arrive. The robot stays at rest.

    After the release, the commands move the robot again.
    """
    with driven(probe, robot):
        assert probe.call(SetBool, "estop", data=True).success
        robot.stands_for_good()
        assert robot.do(lambda board: board.drive.source) == -1
        assert probe.call(SetBool, "estop", data=False).success
        robot.wait_until(lambda board: not board.standing)


def test_a_pause_is_seen_in_the_heartbeat(robot: TwoPorts, probe: Probe) -> None:
    """A user pauses the robot during a drive. The robot stays at rest in the state "paused".

    After the end of the pause, the robot rests until a new command arrives.
    """
    with driven(probe, robot):
        assert probe.call(SetBool, "pause", data=True).success
        robot.stands_for_good()
    probe.wait_for_state("paused")
    assert robot.do(lambda board: board.drive.source) == -1
    assert probe.call(SetBool, "pause", data=False).success
    probe.wait_for_state("nominal")
    robot.stands_for_good()
    moves_again(probe, robot)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL, signal.SIGSTOP])
def test_whatever_ends_the_driver_stops_it(new: New, number: signal.Signals) -> None:
    """A signal ends or suspends the driver during a drive.

    The robot and the brush stop, and the lift stays off.
    """
    robot, driver, probe = new
    assert probe.call(SetBool, "brush", data=True).success
    with driven(probe, robot):
        driver.process.send_signal(number)
        robot.stands_for_good()
    robot.wait_until(lambda board: not board.vehicle.brush and board.vehicle.lift.volts == 0.0)
    if number is signal.SIGSTOP:
        driver.process.send_signal(signal.SIGCONT)
        robot.stands_for_good()


def test_a_driver_that_ends_does_not_move_the_lift_again(new: New) -> None:
    """Lift commands continue to arrive while the driver stops the robot and ends.

    The driver switches the lift off. It does not obey the lift commands that arrive later.
    """
    robot, driver, probe = new
    lift = probe.publisher(Float32, "lift_cmd")
    probe.node.create_timer(0.02, lambda: lift.publish(Float32(data=6.0)))
    with driven(probe, robot):
        robot.wait_until(lambda board: board.vehicle.lift.volts > 0.0)
        before = robot.do(lambda board: len(board.front.commands))
        driver.process.send_signal(signal.SIGINT)
        robot.stands_for_good()
    texts = [obeyed.text for obeyed in robot.do(lambda board: list(board.front.commands))[before:]]
    after = texts[texts.index("motv 0 0") :]
    assert {text for text in after if text.startswith("motv")} == {"motv 0 0"}


def test_jobs_answer(robot: TwoPorts, probe: Probe) -> None:
    """The services that calibrate, and those that save and load the configuration, all succeed."""
    for service in ("calibrate_gyro", "calibrate_accelerometer", "save_configuration"):
        answer = probe.call(Trigger, service)
        assert answer.success, (service, answer.message)
    assert robot.do(lambda board: board.drive.saved.accel_offset_mps2) == pytest.approx(
        (0.08, -0.05, 0.12), abs=0.02
    )
    answer = probe.call(Trigger, "load_configuration")
    assert answer.success, answer.message
    moves_again(probe, robot)


def test_a_calibration_of_the_board_ends_the_drivers_own_bias(
    stack: ExitStack, tmp_path: Path, start_driver: Start, probe_of: Start
) -> None:
    """The board calibrates its gyro and accelerometer. The driver then sets its own biases to 0.

    Regression: the driver still subtracted its biases from readings that the board had corrected.
    """
    robot = robot_of(stack, tmp_path)
    biases = {"gyro_bias": [0.0, 0.0, 0.1], "accel_bias": [0.0, 0.0, 0.5]}
    probe: Probe = probe_of(started(robot, start_driver, **biases))
    probe.wait_for_state("nominal")
    for service, name in (
        ("calibrate_gyro", "gyro_bias"),
        ("calibrate_accelerometer", "accel_bias"),
    ):
        answer = probe.call(Trigger, service)
        assert answer.success, answer.message
        assert f"parameter {name} is now 0" in answer.message
        answer = probe.call(Trigger, service)
        assert answer.success, answer.message
        assert name not in answer.message
    samples = probe.listen(Imu, "imu/data_raw")
    probe.wait_for(lambda: len(samples) > 50)
    rates = [sample.angular_velocity.z for sample in samples]
    forces = [sample.linear_acceleration.z for sample in samples]
    assert sum(rates) / len(rates) == pytest.approx(0.0, abs=0.02)
    assert sum(forces) / len(forces) == pytest.approx(9.81, abs=0.1)


def test_power_off_is_refused_while_driving(
    stack: ExitStack, tmp_path: Path, start_driver: Start, probe_of: Start
) -> None:
    """The driver refuses ``~/power_off`` during a drive.

    At rest, the power goes off after a delay.
    """
    robot = robot_of(stack, tmp_path)
    probe: Probe = probe_of(started(robot, start_driver, power_off_delay=1.0))
    probe.wait_for_state("nominal")
    for _ in range(5):
        with driven(probe, robot):
            answer = probe.call(Trigger, "power_off")
        if not answer.success:
            break
        # On a busy computer, the robot was already at rest. Cancel the power-off, and try again.
        assert probe.call(Trigger, "start").success
    assert not answer.success, answer.message
    robot.stands_for_good()
    assert probe.call(Trigger, "power_off").success
    robot.wait_until(lambda board: not board.drive.powered)


def test_diagnostics_name_the_boards(probe: Probe) -> None:
    """The diagnostics show the version, name and id of each of the two Teensys."""
    diagnoses = probe.listen(DiagnosticArray, "/diagnostics")

    def told() -> set[str]:
        return {pair.value for one in diagnoses for status in one.status for pair in status.values}

    probe.wait_for(lambda: any("110" in text for text in told()))
    text = " ".join(told())
    assert all(word in text for word in ("90", "91", "110", "100", "drive", "front"))
