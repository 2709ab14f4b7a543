# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the driver's topics, as another process receives them over real DDS."""

import math
import struct
from collections.abc import Callable
from itertools import pairwise
from statistics import fmean
from typing import Any

import pytest
from driver_process import PATIENCE_S, Driver
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from probe import Probe
from sensor_msgs.msg import Imu
from std_msgs.msg import String

from omnibot_driver.simulator.omnibot import BoardPose, PtyBoard

Start = Callable[..., Any]


@pytest.fixture
def board(shared: tuple[PtyBoard, Driver]) -> PtyBoard:
    return shared[0]


@pytest.fixture
def driver(shared: tuple[PtyBoard, Driver]) -> Driver:
    return shared[1]


@pytest.fixture
def probe(shared_probe: Probe) -> Probe:
    return shared_probe


def stamp_s(message: Any) -> float:
    stamp = message.header.stamp
    return float(stamp.sec + stamp.nanosec * 1e-9)


def test_every_imu_frame_is_published_once_and_in_order(probe: Probe, board: PtyBoard) -> None:
    """100 IMU messages have the values of 100 consecutive frames of the board."""
    received = probe.listen(Imu, "imu/data_raw")
    probe.wait_for(lambda: len(received) >= 100)
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
        for message in received[:100]
    ]
    first = expected.index(pytest.approx(got[0]))
    for ours, theirs in zip(got, expected[first : first + 100], strict=True):
        assert ours == pytest.approx(theirs)


def test_imu_messages_follow_rep_145(probe: Probe) -> None:
    """An IMU message has covariances and the sensor's frame, but no orientation.

    Its stamps increase.
    """
    received = probe.listen(Imu, "imu/data_raw")
    probe.wait_for(lambda: len(received) >= 50)
    message = received[0]
    assert message.header.frame_id == "imu_link"
    assert message.orientation_covariance[0] == -1.0
    assert message.angular_velocity_covariance[0] == pytest.approx(
        math.radians(0.05) ** 2, rel=0.01
    )
    assert message.linear_acceleration_covariance[8] > 0
    stamps = [stamp_s(message) for message in received]
    assert stamps == sorted(stamps)
    now = probe.node.get_clock().now().nanoseconds * 1e-9
    assert stamps[0] < now < stamps[0] + 60


def test_four_imu_messages_come_for_each_odometry(probe: Probe) -> None:
    """Four IMU messages arrive for each odometry message.

    The test counts by timestamps, so a slow computer has no effect.
    """
    imu, odometry = probe.listen(Imu, "imu/data_raw"), probe.listen(Odometry, "odom")
    probe.wait_for(lambda: imu and len(odometry) >= 10)
    first = len(odometry)
    probe.wait_for(lambda: len(odometry) > first + 40)
    begin_s, end_s = stamp_s(odometry[first]), stamp_s(odometry[first + 40])
    probe.wait_for(lambda: stamp_s(imu[-1]) >= end_s)
    between = sum(begin_s < stamp_s(message) <= end_s for message in imu)
    assert between / 40 == pytest.approx(4.0, abs=0.15)


@pytest.mark.parametrize("told_s", [0.1, 0.04])
def test_a_board_at_10_hz_needs_its_delta_period(
    start_board: Start, start_driver: Start, probe_of: Start, told_s: float
) -> None:
    """A board sends displacements every 0.1 s. With the right ``delta_period``, the twist is right.

    With a wrong ``delta_period``, the driver names the right value.
    """
    board: PtyBoard = start_board(running=True, delta_period_s=0.1)
    driver: Driver = start_driver(board.path, delta_period=told_s)
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    odometry = probe.listen(Odometry, "odom")
    told = "set the parameter `delta_period` to 0.1"

    def right() -> bool:
        newest = odometry[-10:]
        speeds = [message.twist.twist.linear.x for message in newest]
        steps = [stamp_s(after) - stamp_s(before) for before, after in pairwise(newest)]
        return (
            len(odometry) > 40
            and fmean(speeds) == pytest.approx(0.3, abs=0.02)
            and fmean(steps) == pytest.approx(0.1, abs=0.01)
        )

    with probe.commanding(0.3):
        if told_s == 0.04:
            driver.wait_for_line(told)
            return
        probe.wait_for(right)
    assert told not in driver.output


def test_odometry_moves_with_the_robot(probe: Probe, board: PtyBoard) -> None:
    """The robot drives 0.5 m to the left. The pose and the twist in odom show this."""
    odometry = probe.listen(Odometry, "odom")
    commands = probe.publisher(Twist, "cmd_vel")
    probe.wait_for(lambda: odometry)
    assert odometry[0].pose.pose.position.y == pytest.approx(0.0, abs=1e-3)

    def drives(message: Odometry) -> bool:
        speed = message.twist.twist.linear
        return (speed.x, speed.y) == pytest.approx((0.0, 0.4), abs=0.03)

    def drive() -> bool:
        twist = Twist()
        twist.linear.y = 0.4
        commands.publish(twist)
        return odometry[-1].pose.pose.position.y > 0.5 and drives(odometry[-1])

    probe.wait_for(drive)
    probe.forget_message()
    message = next(filter(drives, reversed(odometry)))
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "base_link")
    covariance = message.pose.covariance.reshape(6, 6)
    assert (covariance == covariance.T).all()
    assert all(covariance[i, i] > 0 for i in range(6))
    assert covariance[2, 2] > 1e3
    assert message.twist.covariance[0] > 0
    assert board.wait_for(lambda b: abs(b.truth.vy_mps) < 0.01, PATIENCE_S)
    with board.lock:
        truth = board.board.truth
    probe.wait_for(lambda: odometry[-1].pose.pose.position.y == pytest.approx(truth.y_m, abs=2e-3))


def test_the_state_topic_is_latched(probe: Probe, driver: Driver, probe_of: Start) -> None:
    """A node subscribes to the state topic late. It still receives the current state."""
    late: Probe = probe_of(driver)
    states = late.listen(String, "omnibot_driver/state", latched=True)
    late.wait_for(lambda: states)
    assert [state.data for state in states] == ["nominal"]


def test_an_imu_only_board_is_shown_as_such(
    start_board: Start, start_driver: Start, probe_of: Start
) -> None:
    """A board sends only IMU frames. The state is ``imu_only``, and odom has no messages."""
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
    """A board has driven before, so its own pose is not zero, and its heading is 90°.

    The first pose in odom is nevertheless zero, and the robot faces along x.
    """
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
