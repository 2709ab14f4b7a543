# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What the driver publishes and obeys, as another process sees it over real DDS."""

import math
import struct
from collections.abc import Callable
from typing import Any

import pytest
from driver_process import Driver
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from nav_msgs.msg import Odometry
from probe import Probe
from rclpy.duration import Duration
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Imu
from std_msgs.msg import Bool, Float32MultiArray, String

from omnibot_driver.simulator import BoardPose, PtyBoard, ReceivedCommand, SimulatedBoard

Start = Callable[..., Any]


def obeyed(board: SimulatedBoard, kind: str, *values: int) -> bool:
    return any((command.kind, command.values) == (kind, values) for command in board.commands)


def newest(board: SimulatedBoard) -> ReceivedCommand:
    return board.commands[-1]


def test_every_imu_frame_is_published_once_and_in_order(probe: Probe, board: PtyBoard) -> None:
    """Three hundred of them, with the values that the board sent."""
    received = probe.listen(Imu, "imu/data_raw")
    probe.wait_for(lambda: len(received) >= 300)
    with board.lock:
        sent = [frame.data for frame in board.board.sent if frame.data[:2] == b"\xff\xfa"]
    accel, gyro = 9.80665 / 16384, math.radians(1 / 131)
    expected = [
        tuple(
            word * unit
            for word, unit in zip(
                struct.unpack(">6h", data[2:]), [accel] * 3 + [gyro] * 3, strict=True
            )
        )
        for data in sent
    ]
    got = [
        (
            *(getattr(message.linear_acceleration, axis) for axis in "xyz"),
            *(getattr(message.angular_velocity, axis) for axis in "xyz"),
        )
        for message in received[:300]
    ]
    first = expected.index(pytest.approx(got[0]))
    for ours, theirs in zip(got, expected[first : first + 300], strict=True):
        assert ours == pytest.approx(theirs)


def test_imu_messages_follow_rep_145(probe: Probe) -> None:
    """No orientation, real covariances, the sensor's frame, and stamps that never go back."""
    received = probe.listen(Imu, "imu/data_raw")
    probe.wait_for(lambda: len(received) >= 50)
    message = received[0]
    assert message.header.frame_id == "imu_link"
    assert message.orientation_covariance[0] == -1.0
    assert message.angular_velocity_covariance[0] == pytest.approx(
        math.radians(0.05) ** 2, rel=0.01
    )
    assert message.linear_acceleration_covariance[8] > 0
    stamps = [m.header.stamp.sec + m.header.stamp.nanosec * 1e-9 for m in received]
    assert stamps == sorted(stamps)
    now = probe.node.get_clock().now().nanoseconds * 1e-9
    assert stamps[0] < now < stamps[0] + 60


def test_four_imu_messages_come_for_each_odometry(probe: Probe) -> None:
    """100 Hz and 25 Hz, as a ratio, so that a slow machine does not matter."""
    imu, odometry = probe.listen(Imu, "imu/data_raw"), probe.listen(Odometry, "odom")
    probe.wait_for(lambda: imu and len(odometry) >= 10)
    before = len(imu), len(odometry)
    probe.wait_for(lambda: len(odometry) >= before[1] + 75)
    assert (len(imu) - before[0]) / (len(odometry) - before[1]) == pytest.approx(4.0, abs=0.15)


def test_odometry_moves_with_the_robot(probe: Probe, board: PtyBoard) -> None:
    """Half a metre to the left: pose in odom, twist in base_link, covariance alive."""
    odometry = probe.listen(Odometry, "odom")
    commands = probe.publisher(Twist, "cmd_vel")
    probe.wait_for(lambda: odometry)
    assert odometry[0].pose.pose.position.y == pytest.approx(0.0, abs=1e-3)

    def drive() -> bool:
        twist = Twist()
        twist.linear.y = 0.4
        commands.publish(twist)
        return bool(odometry[-1].pose.pose.position.y > 0.5)

    probe.wait_for(drive)
    message = odometry[-1]
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "base_link")
    assert message.twist.twist.linear.y == pytest.approx(0.4, abs=0.03)
    assert message.twist.twist.linear.x == pytest.approx(0.0, abs=0.03)
    covariance = message.pose.covariance.reshape(6, 6)
    assert (covariance == covariance.T).all()
    assert all(covariance[i, i] > 0 for i in range(6))
    assert covariance[2, 2] > 1e3
    assert message.twist.covariance[0] > 0
    assert board.wait_for(lambda b: abs(b.truth.vy_mps) < 0.01, 20.0)
    with board.lock:
        truth = board.board.truth
    probe.wait_for(lambda: odometry[-1].pose.pose.position.y == pytest.approx(truth.y_m, abs=2e-3))


def test_cmd_vel_reaches_the_board_as_the_manuals_frame(probe: Probe, board: PtyBoard) -> None:
    """0.3 m/s, -0.2 m/s and 0.5 rad/s are 21, -14 and 250 LSB; then it is stopped."""
    commands = probe.publisher(Twist, "cmd_vel")
    twist = Twist()
    twist.linear.x, twist.linear.y, twist.angular.z = 0.3, -0.2, 0.5
    commands.publish(twist)
    assert board.wait_for(lambda b: obeyed(b, "velocity", 21, -14, 250), 20.0)
    assert board.wait_for(lambda b: newest(b) == ReceivedCommand(newest(b).tick, "wheels"), 20.0)


def test_a_zero_twist_is_the_stop_frame(probe: Probe, board: PtyBoard) -> None:
    """Never zeros in mode 1."""
    commands = probe.publisher(Twist, "cmd_vel")
    commands.publish(Twist())
    assert board.wait_for(lambda b: newest(b).kind == "wheels", 20.0)
    with board.lock:
        assert not obeyed(board.board, "velocity", 0, 0, 0)


def test_wheel_cmd_turns_the_wheels(probe: Probe, board: PtyBoard) -> None:
    """10 rad/s of a 29 mm wheel are 20 LSB."""
    commands = probe.publisher(Float32MultiArray, "wheel_cmd")
    commands.publish(Float32MultiArray(data=[10.0, -10.0, 0.0]))
    assert board.wait_for(lambda b: obeyed(b, "wheels", 20, -20, 0), 20.0)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        ([1.0, 2.0], "2 values"),
        ([1.0, 2.0, 3.0, 4.0], "4 values"),
        ([1.0, math.nan, 3.0], "not finite"),
        ([1.0, math.inf, 3.0], "not finite"),
    ],
)
def test_a_wrong_wheel_cmd_is_refused_with_a_reason(
    probe: Probe, driver: Driver, board: PtyBoard, data: list[float], reason: str
) -> None:
    """And the node lives on: a right one still arrives."""
    commands = probe.publisher(Float32MultiArray, "wheel_cmd")
    commands.publish(Float32MultiArray(data=data))
    driver.wait_for_line(f"wheel_cmd refused.*{reason}")
    commands.publish(Float32MultiArray(data=[10.0, 0.0, 0.0]))
    assert board.wait_for(lambda b: obeyed(b, "wheels", 20, 0, 0), 20.0)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
@pytest.mark.parametrize("axis", ["x", "z"])
def test_a_twist_that_is_not_finite_anywhere_is_refused(
    probe: Probe, driver: Driver, board: PtyBoard, bad: float, axis: str
) -> None:
    """Also where the driver would not use the axis: its publisher is not to be trusted."""
    commands = probe.publisher(Twist, "cmd_vel")
    twist = Twist()
    twist.linear.y = 0.3
    setattr(twist.linear, axis, bad)
    commands.publish(twist)
    driver.wait_for_line("cmd_vel refused.*not finite")
    with board.lock:
        assert not any(command.kind == "velocity" for command in board.board.commands)


def test_a_huge_twist_is_limited_in_its_own_direction(probe: Probe, board: PtyBoard) -> None:
    """1e300 to the front left is 0.5 m/s to the front left."""
    commands = probe.publisher(Twist, "cmd_vel")
    twist = Twist()
    twist.linear.x = twist.linear.y = 1e300
    commands.publish(twist)
    assert board.wait_for(lambda b: obeyed(b, "velocity", 25, 25, 0), 20.0)


def test_the_estop_topic_latches_and_never_releases(probe: Probe, board: PtyBoard) -> None:
    """A button node may trip it; only the service lets go."""
    active = probe.listen(Bool, "omnibot_driver/estop_active", latched=True)
    button = probe.publisher(Bool, "estop")
    button.publish(Bool(data=True))
    assert board.wait_for(lambda b: newest(b).kind == "estop", 20.0)
    probe.wait_for(lambda: active and active[-1].data)
    button.publish(Bool(data=False))
    with board.lock:
        count = len(board.board.commands)
    assert board.wait_for(lambda b: len(b.commands) > count + 10, 20.0)
    with board.lock:
        later = list(board.board.commands)[count + 1 :]
    assert {command.kind for command in later} == {"estop"}


def test_the_state_topic_is_latched(probe: Probe, driver: Driver, probe_of: Start) -> None:
    """Who comes late is told what is so."""
    late: Probe = probe_of(driver)
    states = late.listen(String, "omnibot_driver/state", latched=True)
    late.wait_for(lambda: states)
    assert [state.data for state in states] == ["nominal"]


def test_stamped_commands_are_taken_instead_when_the_parameter_says_so(
    board: PtyBoard, start_driver: Start, probe_of: Start
) -> None:
    """geometry_msgs/TwistStamped on the same topic."""
    probe: Probe = probe_of(start_driver(board.path, enable_stamped_cmd_vel=True))
    probe.wait_for_state("nominal")
    commands = probe.publisher(TwistStamped, "cmd_vel")
    stamped = TwistStamped()
    stamped.twist.linear.x = 0.3
    stamped.header.stamp = probe.node.get_clock().now().to_msg()
    commands.publish(stamped)
    assert board.wait_for(lambda b: obeyed(b, "velocity", 21, 0, 0), 20.0)


def test_a_stale_stamped_command_is_refused_with_its_age_and_an_unstamped_one_is_taken(
    board: PtyBoard, start_driver: Start, probe_of: Start
) -> None:
    """Older than cmd_vel_timeout; a zero stamp is none."""
    driver: Driver = start_driver(board.path, enable_stamped_cmd_vel=True)
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    commands = probe.publisher(TwistStamped, "cmd_vel")
    stamped = TwistStamped()
    stamped.twist.linear.x = 0.3
    stamped.header.stamp = (probe.node.get_clock().now() - Duration(seconds=60)).to_msg()
    commands.publish(stamped)
    driver.wait_for_line(r"cmd_vel refused: it is 60\.\d\d s old")
    with board.lock:
        assert not any(command.kind == "velocity" for command in board.board.commands)
    stamped = TwistStamped()
    stamped.twist.linear.x = 0.3
    commands.publish(stamped)
    assert board.wait_for(lambda b: obeyed(b, "velocity", 21, 0, 0), 20.0)


def test_who_publishes_the_other_type_is_named_once(probe: Probe, driver: Driver) -> None:
    """The middleware would leave them unheard in silence."""
    probe.node.create_publisher(TwistStamped, "cmd_vel", 1)
    driver.wait_for_line("probe publishes something else.*enable_stamped_cmd_vel:=true")


def test_a_publisher_whose_quality_of_service_does_not_fit_is_told(
    probe: Probe, driver: Driver
) -> None:
    """Commands are taken reliably; what may be lost on the way is not."""
    quality = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    probe.node.create_publisher(Twist, "cmd_vel", quality)
    driver.wait_for_line("incompatible QoS.*RELIABILITY")


def test_a_goal_is_driven_to_with_the_switch_on_position_and_velocities_are_refused(
    start_board: Start, start_driver: Start, probe_of: Start
) -> None:
    """A quarter of a metre ahead, in odom; the board has a frame of its own."""
    board = start_board(
        control="position", running=True, initial_pose=BoardPose(1000.0, 2000.0, 1570.8)
    )
    driver: Driver = start_driver(board.path, control_method="position")
    probe: Probe = probe_of(driver)
    odometry = probe.listen(Odometry, "odom")
    probe.wait_for_state("nominal")
    probe.wait_for(lambda: len(odometry) > 10)
    goal = PoseStamped()
    goal.header.frame_id = "odom"
    goal.pose.position.x = 0.25
    goal.pose.orientation.w = 1.0
    probe.publisher(PoseStamped, "cmd_pose").publish(goal)
    assert board.wait_for(lambda b: newest(b).kind == "pose", 20.0)
    probe.wait_for(lambda: odometry[-1].pose.pose.position.x == pytest.approx(0.25, abs=0.005))
    assert odometry[-1].pose.pose.position.y == pytest.approx(0.0, abs=0.005)
    probe.publisher(Twist, "cmd_vel").publish(Twist())
    driver.wait_for_line("cmd_vel refused.*control_method.*position")
    goal.header.frame_id = "map"
    probe.publisher(PoseStamped, "cmd_pose").publish(goal)
    driver.wait_for_line("cmd_pose refused.*'map'.*transform it")


def test_an_imu_only_board_is_shown_as_such(
    start_board: Start, start_driver: Start, probe_of: Start
) -> None:
    """IMU messages flow, odometry does not."""
    board = start_board(imu_only=True)
    probe: Probe = probe_of(start_driver(board.path))
    imu, odometry = probe.listen(Imu, "imu/data_raw"), probe.listen(Odometry, "odom")
    probe.wait_for_state("imu_only")
    before = len(imu)
    probe.wait_for(lambda: len(imu) > before + 50)
    assert not odometry


def test_frames_of_a_board_that_has_driven_before_begin_at_the_identity(
    start_board: Start, start_driver: Start, probe_of: Start
) -> None:
    """Its heading is a quarter turn; driving forward is still x in odom."""
    board = start_board(initial_pose=BoardPose(1000.0, 2000.0, 1570.8), running=True)
    probe: Probe = probe_of(start_driver(board.path))
    odometry = probe.listen(Odometry, "odom")
    probe.wait_for_state("nominal")
    commands = probe.publisher(Twist, "cmd_vel")
    probe.wait_for(lambda: odometry)

    def drive() -> bool:
        twist = Twist()
        twist.linear.x = 0.4
        commands.publish(twist)
        return bool(odometry[-1].pose.pose.position.x > 0.2)

    probe.wait_for(drive)
    assert odometry[-1].pose.pose.position.y == pytest.approx(0.0, abs=2e-3)
