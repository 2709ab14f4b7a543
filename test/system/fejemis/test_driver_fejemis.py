# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The driver with a simulated Fejemis on two real pseudo-terminals."""

import math
import signal
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from driver_process import Driver
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from probe import Probe
from sensor_msgs.msg import BatteryState, Imu, JointState, MagneticField, Range
from std_msgs.msg import ColorRGBA, Float32
from std_srvs.srv import SetBool, Trigger
from two_ports import DRIVE, FRONT, TwoPorts

from omnibot_driver.simulator.fejemis import FejemisSettings, Firmware, SimulatedFejemis

Start = Callable[..., Any]
NODE: Final = "omnibot_driver"


def robot_of(stack: ExitStack, folder: Path, **settings: Any) -> TwoPorts:
    board = SimulatedFejemis(FejemisSettings(**settings))
    return stack.enter_context(TwoPorts(board, folder))


@pytest.fixture
def robot(stack: ExitStack, tmp_path: Path) -> TwoPorts:
    return robot_of(stack, tmp_path)


@pytest.fixture
def driver(robot: TwoPorts, start_driver: Start) -> Driver:
    return started(robot, start_driver)


def started(robot: TwoPorts, start_driver: Start, **parameters: object) -> Driver:
    port, front_port = robot.ports
    driver: Driver = start_driver(port, board="fejemis", front_port=front_port, **parameters)
    return driver


@pytest.fixture
def probe(driver: Driver, probe_of: Start) -> Probe:
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    return probe


@contextmanager
def driven(probe: Probe, robot: TwoPorts, vx: float = 0.3, yaw: float = 0.0) -> Iterator[None]:
    """Commanded ten times a second; begins when it moves."""
    publisher = probe.publisher(Twist, "cmd_vel")
    twist = Twist()
    twist.linear.x, twist.angular.z = vx, yaw
    timer = probe.node.create_timer(0.1, lambda: publisher.publish(twist))
    try:
        robot.wait_until(lambda board: not board.standing)
        yield
    finally:
        probe.remove(timer)


def moves_again(probe: Probe, robot: TwoPorts) -> None:
    """By a fresh command."""
    with driven(probe, robot):
        pass
    robot.stands_for_good()


def test_it_drives_and_odometry_tells_how_far(robot: TwoPorts, probe: Probe) -> None:
    """Ahead, then on the spot, then in a curve; commands that cease stop it."""
    odometry = probe.listen(Odometry, "odom")
    joints = probe.listen(JointState, "joint_states")
    with driven(probe, robot):
        probe.wait_for(lambda: odometry and odometry[-1].pose.pose.position.x > 0.7)
    with driven(probe, robot, 0.0, 0.5):
        robot.wait_until(lambda board: board.truth.yaw_rad > 1.0)
    with driven(probe, robot, 0.3, -0.3):
        robot.wait_until(lambda board: board.truth.yaw_rad < 0.5)
    robot.stands_for_good()
    truth = robot.do(lambda board: board.truth)
    seen = len(odometry)
    probe.wait_for(lambda: len(odometry) > seen + 10)
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
    """In SI units, in the frames of the description."""
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


def test_brush_lift_and_light_obey_and_end_with_the_estop(robot: TwoPorts, probe: Probe) -> None:
    """None comes back by itself."""
    lift, led = probe.publisher(Float32, "lift_cmd"), probe.publisher(ColorRGBA, "led_cmd")
    led.publish(ColorRGBA(r=1.0, g=0.5, b=0.0, a=1.0))
    robot.wait_until(lambda board: board.front.leds[5] == (255, 128, 0))
    assert probe.call(SetBool, "brush", data=True).success
    robot.wait_until(lambda board: board.vehicle.brush)
    lift.publish(Float32(data=6.0))
    robot.wait_until(lambda board: board.vehicle.lift.volts == 6.0)
    robot.wait_until(lambda board: board.vehicle.lift.volts == 0.0)  # with cmd_vel_timeout
    timer = probe.node.create_timer(0.1, lambda: lift.publish(Float32(data=-8.0)))
    robot.wait_until(lambda board: board.vehicle.lift.volts == -8.0)
    assert probe.call(SetBool, "estop", data=True).success
    robot.wait_until(lambda board: not board.vehicle.brush and board.vehicle.lift.volts == 0.0)
    answer = probe.call(SetBool, "brush", data=True)
    assert not answer.success
    assert "release" in answer.message
    probe.remove(timer)
    assert probe.call(SetBool, "estop", data=False).success
    robot.stands_for_good()
    assert not robot.do(lambda board: board.vehicle.brush or board.vehicle.lift.volts)


def test_the_estop_stops_it_until_it_is_released(robot: TwoPorts, probe: Probe) -> None:
    """Although commands go on: ``stop`` on drive, which shows it in its heartbeat."""
    with driven(probe, robot):
        assert probe.call(SetBool, "estop", data=True).success
        robot.stands_for_good()
        assert robot.do(lambda board: board.drive.source) == -1
        assert probe.call(SetBool, "estop", data=False).success
        robot.wait_until(lambda board: not board.standing)


def test_a_pause_is_seen_in_the_heartbeat(robot: TwoPorts, probe: Probe) -> None:
    """It ends with ``~/pause`` false; an earlier command has no effect."""
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
def test_whatever_ends_the_driver_stops_it(
    robot: TwoPorts, driver: Driver, probe: Probe, number: signal.Signals
) -> None:
    """Its own exit, or the guard: the robot stands, brush and lift are off."""
    assert probe.call(SetBool, "brush", data=True).success
    with driven(probe, robot):
        driver.process.send_signal(number)
        robot.stands_for_good()
    robot.wait_until(lambda board: not board.vehicle.brush and board.vehicle.lift.volts == 0.0)
    if number is signal.SIGSTOP:
        driver.process.send_signal(signal.SIGCONT)
        robot.stands_for_good()


@pytest.mark.parametrize(("channel", "name"), [(DRIVE, "drive"), (FRONT, "front")])
def test_a_half_that_is_unplugged_while_driving_stops_the_robot(
    robot: TwoPorts, driver: Driver, probe: Probe, channel: int, name: str
) -> None:
    """The other half hears it, and the lost one once it is back; the brush stays off."""
    assert probe.call(SetBool, "brush", data=True).success
    with driven(probe, robot):
        robot.unplug(channel)
        probe.wait_for_state("connecting")
        driver.wait_for_line(rf"lost.*{name}|{name}.*(lost|missing|not heard)")
        if channel == FRONT:
            robot.stands_for_good()
        else:
            robot.wait_until(lambda board: not board.vehicle.brush)
    robot.plug(channel)
    robot.stands_for_good()
    probe.wait_for_state("nominal")
    assert not robot.do(lambda board: board.vehicle.brush)
    subscriptions = robot.do(lambda board: board.half(name).subscriptions)
    assert len(subscriptions) > 1
    moves_again(probe, robot)


@pytest.mark.parametrize("name", ["drive", "front"])
@pytest.mark.parametrize("what", ["restart", "silent"])
def test_a_half_that_restarts_or_falls_silent_stops_the_robot(
    robot: TwoPorts, driver: Driver, probe: Probe, name: str, what: str
) -> None:
    """The robot obeys again once both halves work."""
    with driven(probe, robot):
        robot.do(lambda board: board.befall(name, what))
        if what != "restart":
            probe.wait_for_state("connecting")
            driver.wait_for_line(name)
            robot.stands_for_good()
    robot.do(lambda board: board.befall(name, "well"))
    robot.stands_for_good()
    probe.wait_for_state("nominal")
    moves_again(probe, robot)


@pytest.mark.parametrize("what", ["sensor-error", "hall-broken"])
def test_a_broken_angle_sensor_stops_the_robot(
    robot: TwoPorts, driver: Driver, probe: Probe, what: str
) -> None:
    """One sentence says what is wrong with it."""
    with driven(probe, robot):
        robot.do(lambda board: board.befall("front", what))
        robot.stands_for_good()
    driver.wait_for_line("angle sensor")
    robot.do(lambda board: board.befall("front", "sensor-well"))
    moves_again(probe, robot)


def test_swapped_ports_are_found_out(
    stack: ExitStack, tmp_path: Path, start_driver: Start, probe_of: Start
) -> None:
    """By the ids in the heartbeats; the robot drives as usual."""
    robot = robot_of(stack, tmp_path, swapped=True)
    driver = started(robot, start_driver)
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    driver.wait_for_line("swapped")
    moves_again(probe, robot)


def test_it_drives_without_sums(
    stack: ExitStack, tmp_path: Path, start_driver: Start, probe_of: Start
) -> None:
    """Learnt from the heartbeats: the firmware complains of no line once that is done."""
    robot = robot_of(stack, tmp_path, firmware=Firmware(sums=False))
    probe: Probe = probe_of(started(robot, start_driver))
    probe.wait_for_state("nominal")
    before = robot.do(lambda board: board.drive.unhandled + board.front.unhandled)
    moves_again(probe, robot)
    assert robot.do(lambda board: board.drive.unhandled + board.front.unhandled) == before


def test_the_same_port_twice_ends_the_start(robot: TwoPorts, start_driver: Start) -> None:
    """In one sentence."""
    driver: Driver = start_driver(robot.ports[0], board="fejemis", front_port=robot.ports[0])
    driver.wait_for_line("'front_port' must not be .* have a port each")
    assert driver.end() == 2


@pytest.mark.parametrize(
    ("ids", "wrong"),
    [((42, 91), "id 42"), ((90, 7), "id 7"), ((90, 90), "both ports lead to a drive board")],
)
def test_a_teensy_of_another_kind_is_named_and_nothing_moves(
    stack: ExitStack,
    tmp_path: Path,
    start_driver: Start,
    probe_of: Start,
    ids: tuple[int, int],
    wrong: str,
) -> None:
    """By its id."""
    robot = robot_of(stack, tmp_path, ids=ids)
    driver = started(robot, start_driver)
    probe: Probe = probe_of(driver)
    driver.wait_for_line(wrong)
    probe.wait_for_state("connecting")
    publisher = probe.publisher(Twist, "cmd_vel")
    twist = Twist()
    twist.linear.x = 0.3
    timer = probe.node.create_timer(0.1, lambda: publisher.publish(twist))
    robot.stands_for_good()
    probe.remove(timer)
    assert robot.do(lambda board: board.truth.x_m) == 0.0


def test_jobs_answer(robot: TwoPorts, probe: Probe) -> None:
    """Calibrations, and the configuration."""
    for service in ("calibrate_gyro", "calibrate_accelerometer", "save_configuration"):
        answer = probe.call(Trigger, service)
        assert answer.success, (service, answer.message)
    assert robot.do(lambda board: board.drive.saved.accel_offset_mps2) == pytest.approx(
        (0.08, -0.05, 0.12), abs=0.02
    )
    answer = probe.call(Trigger, "load_configuration")
    assert answer.success, answer.message
    moves_again(probe, robot)


def test_power_off_is_refused_while_driving(
    stack: ExitStack, tmp_path: Path, start_driver: Start, probe_of: Start
) -> None:
    """At rest both boards lose their power after the delay."""
    robot = robot_of(stack, tmp_path)
    probe: Probe = probe_of(started(robot, start_driver, power_off_delay=1.0))
    probe.wait_for_state("nominal")
    with driven(probe, robot):
        answer = probe.call(Trigger, "power_off")
        assert not answer.success, answer.message
    robot.stands_for_good()
    assert probe.call(Trigger, "power_off").success
    robot.wait_until(lambda board: not board.drive.powered)


def test_diagnostics_name_the_boards(probe: Probe) -> None:
    """Version, name and id of each."""
    diagnoses = probe.listen(DiagnosticArray, "/diagnostics")

    def told() -> set[str]:
        return {pair.value for one in diagnoses for status in one.status for pair in status.values}

    probe.wait_for(lambda: any("110" in text for text in told()))
    text = " ".join(told())
    assert all(word in text for word in ("90", "91", "110", "100", "drive", "front"))
