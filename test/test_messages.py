# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the conversion of values to ROS messages.

REP-103, REP-105 and REP-145 say where each number has to be.
"""

import math

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, Twist
from hypothesis import given
from hypothesis import strategies as st

from omnibot_driver import boards, command_messages, messages
from omnibot_driver.boards import omnibot
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.geometry.omni import OmniKinematics
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.core.odometry.covariance import Covariance
from omnibot_driver.core.odometry.estimate import OdometryEstimate
from omnibot_driver.core.reporting.status import Level, Status

DEFAULTS = boards.check_all({})
SETTINGS = messages.MessageSettings.from_parameters(DEFAULTS, omnibot.kinematics(DEFAULTS))
PREFIXED = messages.MessageSettings.from_parameters(
    boards.check_all({"frame_prefix": "robot1/"}), omnibot.kinematics(DEFAULTS)
)
STAMP = messages.time_message(1_700_000_000_123_456_789)


def test_a_stamp_is_seconds_and_nanoseconds() -> None:
    """The conversion of a time to seconds and nanoseconds is exact, without floating point."""
    assert (STAMP.sec, STAMP.nanosec) == (1_700_000_000, 123_456_789)


@pytest.mark.parametrize(("sec", "nanosec", "age_s"), [(98, 0, 2.0), (102, 5 * 10**8, -2.5)])
def test_a_stamp_has_an_age_by_the_clock_that_gave_it(sec: int, nanosec: int, age_s: float) -> None:
    """The age of a stamp is the time since the stamp. It is negative for a stamp in the future."""
    assert command_messages.age(Time(sec=sec, nanosec=nanosec), 100 * 10**9) == pytest.approx(age_s)


def test_a_zero_stamp_is_not_a_stamp() -> None:
    """A zero stamp means that a command has no stamp, so its age is 0."""
    assert command_messages.age(Time(), 1_700_000_000 * 10**9) == 0.0


def goal(
    x: float = 0.0, y: float = 0.0, turn: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0), frame: str = ""
) -> PoseStamped:
    message = PoseStamped()
    message.header.frame_id = frame
    message.pose.position.x, message.pose.position.y = x, y
    orientation = message.pose.orientation
    orientation.x, orientation.y, orientation.z, orientation.w = turn
    return message


@given(st.floats(-math.pi, math.pi), st.floats(0.01, 100.0))
def test_a_goal_has_the_yaw_of_its_quaternion_whatever_its_length(
    yaw_rad: float, length: float
) -> None:
    """A goal's yaw does not depend on the length of its quaternion.

    Some senders do not normalize the quaternion.
    """
    turn = (0.0, 0.0, length * math.sin(yaw_rad / 2), length * math.cos(yaw_rad / 2))
    pose = command_messages.goal_pose(goal(1.0, -2.0, turn), "odom")
    assert (pose.x_m, pose.y_m) == (1.0, -2.0)
    assert math.remainder(pose.yaw_rad - yaw_rad, math.tau) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("frame", ["", "odom"])
def test_a_goal_is_in_the_odometry_frame_or_in_none(frame: str) -> None:
    """A goal with an empty frame is accepted. It counts as a goal in the odometry frame."""
    assert command_messages.goal_pose(goal(1.0, frame=frame), "odom") == Pose(1.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (goal(frame="map"), "in 'map'; transform it to 'odom'"),
        (goal(frame="/odom"), "in '/odom'"),
        (goal(math.nan), "NaN or infinity"),
        (goal(turn=(0.0, 0.0, math.inf, 1.0)), "NaN or infinity"),
        (goal(turn=(0.0, 0.0, 0.0, 0.0)), "set w to 1"),
        (goal(turn=(1e300, 0.0, 0.0, 0.0)), "unit quaternion"),
        (goal(turn=(1.0, 0.0, 0.0, 0.0)), "tilted by 180°"),
        (goal(turn=(0.0, math.sin(0.25), 0.0, math.cos(0.25))), "tilted by 29°"),
    ],
)
def test_a_goal_that_is_not_a_place_on_the_floor_is_refused_with_a_reason(
    wrong: PoseStamped, said: str
) -> None:
    """The driver rejects a goal with a wrong frame, NaN or infinity, or an invalid rotation."""
    with pytest.raises(CommandRefused, match=f"cmd_pose re(fus|ject)ed.*{said}"):
        command_messages.goal_pose(wrong, "odom")


def test_the_clock_offset_has_no_jitter_but_follows_a_step() -> None:
    """The offset between two clocks is estimated from readings of both.

    A late reading does not change the offset. If one of the clocks is set, the offset follows.
    """
    offset = messages.clock_offset(0, 1_000, 500_001_002, 1_004)
    assert 500_000_000 - 2 <= offset <= 500_000_002
    assert messages.clock_offset(offset, 2_000, 500_002_900, 903_000) == offset
    assert messages.clock_offset(offset, 3_000, 900_003_002, 3_004) == 899_999_998
    assert messages.clock_offset(offset, 3_000, 100_003_002, 3_004) == 100_000_002


def test_odometry_has_its_numbers_where_rep_103_wants_them() -> None:
    """The pose is in odom, and the twist in base_link.

    A covariance is a matrix over x, y, z and three angles, row by row.
    """
    estimate = OdometryEstimate(
        0.0,
        Pose(1.0, 2.0, math.pi / 2),
        BodyTwist(0.1, 0.2, 0.3),
        Covariance(xx=11.0, xy=12.0, x_yaw=1.6, yy=22.0, y_yaw=2.6, yaw_yaw=3.0),
    )
    message = messages.odometry_message(estimate, STAMP, SETTINGS)
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "base_link")
    assert message.header.stamp == STAMP
    position, turn = message.pose.pose.position, message.pose.pose.orientation
    assert (position.x, position.y, position.z) == (1.0, 2.0, 0.0)
    assert (turn.x, turn.y) == (0.0, 0.0)
    assert (turn.z, turn.w) == pytest.approx((math.sqrt(0.5), math.sqrt(0.5)))
    assert (message.twist.twist.linear.x, message.twist.twist.linear.y) == (0.1, 0.2)
    assert message.twist.twist.angular.z == 0.3
    pose = message.pose.covariance.reshape(6, 6)
    assert pose[0, 0] == 11.0
    assert pose[0, 1] == pose[1, 0] == 12.0
    assert pose[0, 5] == pose[5, 0] == 1.6
    assert pose[1, 1] == 22.0
    assert pose[1, 5] == pose[5, 1] == 2.6
    assert pose[5, 5] == 3.0
    assert pose[2, 2] == pose[3, 3] == pose[4, 4] == messages.UNMEASURED_VARIANCE
    twist = message.twist.covariance.reshape(6, 6)
    assert twist[0, 0] == twist[1, 1] == pytest.approx(0.02**2)
    assert twist[5, 5] == pytest.approx(0.025**2)


def test_an_unknown_heading_is_published_with_the_variance_of_an_unknown_direction() -> None:
    """The yaw variance of an estimate is 66 rad², too large for the error of a direction.

    The message ``odom`` has π²/3 rad² instead, and the same variances of the position. The matrix
    is positive definite.
    """
    estimate = OdometryEstimate(
        0.0,
        Pose(),
        None,
        Covariance(xx=11.0, xy=1.0, x_yaw=16.0, yy=22.0, y_yaw=26.0, yaw_yaw=66.0),
    )
    message = messages.odometry_message(estimate, STAMP, SETTINGS)
    pose = message.pose.covariance.reshape(6, 6)
    assert pose[5, 5] == pytest.approx(math.pi**2 / 3)
    assert (pose[0, 0], pose[0, 1], pose[1, 1]) == (11.0, 1.0, 22.0)
    assert min(np.linalg.eigvalsh(pose)) > 0.0


def test_a_twist_that_is_not_known_is_zero_with_a_variance_that_says_so() -> None:
    """An unknown twist is published as zero with a large variance.

    For example, the twist is unknown after a pause, because the first displacement contains all
    motion during the pause.
    """
    message = messages.odometry_message(
        OdometryEstimate(0.0, Pose(), None, Covariance()), STAMP, SETTINGS
    )
    assert message.twist.twist.linear.x == 0.0
    assert message.twist.covariance[[0, 7, 35]].tolist() == [messages.UNMEASURED_VARIANCE] * 3


def test_an_imu_message_has_no_orientation() -> None:
    """The orientation's covariance begins with -1, which means "unknown" by REP-145.

    Specific force and angular rate are copied unchanged from the estimate.
    """
    estimate = ImuEstimate(0.0, (1.0, 2.0, -9.8), (0.1, 0.2, 0.3))
    message = messages.imu_message(estimate, STAMP, SETTINGS)
    assert message.header.frame_id == "imu_link"
    assert message.orientation_covariance[0] == -1.0
    force, rate = message.linear_acceleration, message.angular_velocity
    assert (force.x, force.y, force.z) == (1.0, 2.0, -9.8)
    assert (rate.x, rate.y, rate.z) == (0.1, 0.2, 0.3)
    assert message.linear_acceleration_covariance[[0, 4, 8]] == pytest.approx(0.028**2)
    assert message.angular_velocity_covariance[[0, 4, 8]] == pytest.approx(0.00087**2)


poses = st.builds(Pose, *[st.floats(-1e4, 1e4)] * 3)


@given(poses)
def test_the_transform_is_the_odometrys_pose_between_the_same_frames(pose: Pose) -> None:
    """A transform has the pose, the frames and the time of odometry."""
    estimate = OdometryEstimate(0.0, pose, None, Covariance())
    odometry = messages.odometry_message(estimate, STAMP, PREFIXED)
    transform = messages.transform_message(estimate, STAMP, PREFIXED)
    assert transform.header == odometry.header
    assert transform.header.frame_id == "robot1/odom"
    assert transform.child_frame_id == odometry.child_frame_id == "robot1/base_link"
    at, position = transform.transform.translation, odometry.pose.pose.position
    assert (at.x, at.y, at.z) == (position.x, position.y, position.z) == (pose.x_m, pose.y_m, 0.0)
    assert transform.transform.rotation == odometry.pose.pose.orientation


def test_every_frame_has_the_prefix_as_it_is() -> None:
    """Every frame name gets the prefix without a separator, as in robot_state_publisher."""
    assert PREFIXED.odom_frame == "robot1/odom"
    assert PREFIXED.base_frame == "robot1/base_link"
    estimate = ImuEstimate(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert messages.imu_message(estimate, STAMP, PREFIXED).header.frame_id == "robot1/imu_link"
    assert command_messages.goal_pose(goal(frame="robot1/odom"), PREFIXED.odom_frame) == Pose()


def test_joint_states_are_the_manuals_wheels() -> None:
    """The robot drives 1 m forward at 0.1 m/s. The wheels have a radius of 29 mm.

    Wheel A turns backwards, B turns forwards, and C does not turn.
    """
    estimate = OdometryEstimate(
        0.0, Pose(), None, Covariance(), Pose(1.0, 0.0, 0.0), BodyTwist(0.1, 0.0, 0.0)
    )
    wheels = messages.turned(messages.unturned(SETTINGS.wheels), estimate, SETTINGS.wheels)
    message = messages.joint_state_message(wheels, STAMP, SETTINGS)
    assert message.header.stamp == STAMP
    assert list(message.name) == ["wheel_a_joint", "wheel_b_joint", "wheel_c_joint"]
    turned = 0.8660254037844386 / 0.029
    assert list(message.position) == pytest.approx([-turned, turned, 0.0])
    assert list(message.velocity) == pytest.approx([-turned / 10, turned / 10, 0.0])
    assert not message.effort


def test_joints_whose_rate_is_not_known_have_none() -> None:
    """If the wheels' rates are unknown, the array of rates is empty, as sensor_msgs requires."""
    estimate = OdometryEstimate(0.0, Pose(), None, Covariance(), Pose(1.0, 0.0, 0.0), None)
    wheels = messages.turned(messages.unturned(SETTINGS.wheels), estimate, SETTINGS.wheels)
    message = messages.joint_state_message(wheels, STAMP, SETTINGS)
    assert len(message.position) == 3
    assert not message.velocity


def test_wheels_of_another_size_go_on_from_where_they_stand() -> None:
    """The user changes the wheel radius. The change itself turns no joint.

    The driver divides each further distance by the new radius.
    """
    small, large = OmniKinematics(0.029, 0.143), OmniKinematics(0.058, 0.2)
    ahead = [OdometryEstimate(0.0, Pose(), None, Covariance(), Pose(x, 0.0, 0.0)) for x in (1, 2)]
    before = messages.turned(messages.unturned(SETTINGS.wheels), ahead[0], small)
    assert messages.turned(before, ahead[0], large)[1] == before[1]
    after = messages.turned(before, ahead[1], large)
    assert after[1] == pytest.approx([1.5 * angle for angle in before[1]])


def test_diagnostics_are_named_as_by_diagnostic_updater() -> None:
    """The name of a status is the node, a colon and the task. Its level is one byte."""
    statuses = [
        Status("Link", Level.OK, "connected", {"Port": "p"}),
        Status("IMU", Level.STALE, "nothing", {}),
    ]
    message = messages.diagnostic_message(statuses, STAMP, "omnibot_driver", "/dev/ttyUSB0")
    assert message.header.stamp == STAMP
    link, imu = message.status
    assert (link.name, link.level, link.message) == ("omnibot_driver: Link", b"\0", "connected")
    assert link.hardware_id == imu.hardware_id == "/dev/ttyUSB0"
    assert [(value.key, value.value) for value in link.values] == [("Port", "p")]
    assert imu.level == b"\3"


@given(st.floats(-1e4, 1e4))
def test_a_yaw_becomes_a_unit_quaternion(yaw_rad: float) -> None:
    """The quaternion of any yaw, also of several turns, has the length 1."""
    turn = messages.yaw_quaternion(yaw_rad)
    assert math.hypot(turn.z, turn.w) == pytest.approx(1.0)
    assert math.cos(2 * math.atan2(turn.z, turn.w)) == pytest.approx(math.cos(yaw_rad), abs=1e-6)


@pytest.mark.parametrize("axis", ["linear.x", "linear.z", "angular.x", "angular.y", "angular.z"])
def test_a_twist_that_is_not_finite_anywhere_is_refused_as_it_came(axis: str) -> None:
    """A Twist with infinity on one axis is rejected. The error gives the values of all axes."""
    twist = Twist()
    part, name = axis.split(".")
    twist.linear.y = 0.25
    setattr(getattr(twist, part), name, math.inf)
    with pytest.raises(CommandRefused, match=r"NaN or infinity.*(0\.25.*inf|inf.*0\.25)"):
        command_messages.body_twist(twist)
