# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Conversion of the core's values to ROS messages: pure functions without a node.

Conventions: REP-103 (axes, units), REP-105 (odom to base_link), REP-145 (IMU without orientation).
"""

import math
from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from operator import add
from typing import Any, Final

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, Quaternion, Transform, TransformStamped, Vector3
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, JointState, Range
from std_msgs.msg import Header, UInt8MultiArray

from omnibot_driver.core.geometry.kinematics import Kinematics
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.core.odometry.estimate import OdometryEstimate
from omnibot_driver.core.reporting.status import Status
from omnibot_driver.parameters import RANGE_TYPES

UNMEASURED_VARIANCE: Final = 1e6
"""Variance of values that are not measured: z, roll and pitch of planar odometry, and an unknown
twist."""
RADIATION: Final = dict(zip(RANGE_TYPES, (Range.ULTRASOUND, Range.INFRARED), strict=True))
"""Value of ``radiation_type`` in sensor_msgs/Range, by the type of the sensor."""
NO_ORIENTATION: Final = [-1.0] + [0.0] * 8

Wheels = tuple[Pose, tuple[float, ...], tuple[float, ...]]
"""State of the wheels: summed displacements of the robot along the board's axes (m, rad), wheel
angles in rad, and wheel rates in rad/s (empty if unknown)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MessageSettings:
    """What messages contain besides measurements: frame names, standard deviations and wheels.

    Frame names begin with the parameter ``frame_prefix``. Standard deviations are in SI units, and
    0 if the board has no such parameter.
    """

    odom_frame: str
    base_frame: str
    imu_frame: str
    acceleration_stddev: float
    angular_velocity_stddev: float
    twist_linear_stddev: float
    twist_angular_stddev: float
    wheels: Kinematics

    @classmethod
    def from_parameters(cls, values: Mapping[str, Any], wheels: Kinematics) -> "MessageSettings":
        """Make the settings from checked parameter values and the kinematics of the wheels."""
        prefix = values["frame_prefix"]
        return cls(
            odom_frame=prefix + values["odom_frame"],
            base_frame=prefix + values["base_frame"],
            imu_frame=prefix + values.get("imu_frame", ""),
            acceleration_stddev=values.get("linear_acceleration_stddev", 0.0),
            angular_velocity_stddev=values.get("angular_velocity_stddev", 0.0),
            twist_linear_stddev=values.get("twist_linear_stddev", 0.0),
            twist_angular_stddev=values.get("twist_angular_stddev", 0.0),
            wheels=wheels,
        )


def imu_message(estimate: ImuEstimate, stamp: Time, settings: MessageSettings) -> Imu:
    """Return an ``imu/data_raw`` message: specific force and angular velocity, in sensor axes."""
    force, rate = estimate.specific_force, estimate.angular_velocity
    return Imu(
        header=Header(stamp=stamp, frame_id=settings.imu_frame),
        orientation_covariance=NO_ORIENTATION,
        angular_velocity=Vector3(x=rate[0], y=rate[1], z=rate[2]),
        angular_velocity_covariance=isotropic(settings.angular_velocity_stddev),
        linear_acceleration=Vector3(x=force[0], y=force[1], z=force[2]),
        linear_acceleration_covariance=isotropic(settings.acceleration_stddev),
    )


def odometry_message(
    estimate: OdometryEstimate, stamp: Time, settings: MessageSettings
) -> Odometry:
    """Return an ``odom`` message: pose in the odometry frame, twist in the base's own axes."""
    pose, twist, covariance = estimate.pose, estimate.twist, estimate.covariance.of_direction
    message = Odometry(
        header=Header(stamp=stamp, frame_id=settings.odom_frame),
        child_frame_id=settings.base_frame,
    )
    message.pose.pose.position = Point(x=pose.x_m, y=pose.y_m, z=0.0)
    message.pose.pose.orientation = yaw_quaternion(pose.yaw_rad)
    message.pose.covariance = planar(
        covariance.xx,
        covariance.xy,
        covariance.x_yaw,
        covariance.yy,
        covariance.y_yaw,
        covariance.yaw_yaw,
    )
    if twist is None:
        message.twist.covariance = TWIST_NOT_KNOWN
        return message
    message.twist.twist.linear = Vector3(x=twist.vx_mps, y=twist.vy_mps, z=0.0)
    message.twist.twist.angular = Vector3(x=0.0, y=0.0, z=twist.yaw_rate_radps)
    linear, angular = estimate.twist_variances or (
        settings.twist_linear_stddev**2,
        settings.twist_angular_stddev**2,
    )
    message.twist.covariance = planar(linear, 0.0, 0.0, linear, 0.0, angular)
    return message


def transform_message(
    estimate: OdometryEstimate, stamp: Time, settings: MessageSettings
) -> TransformStamped:
    """Return a ``/tf`` transform: the pose of the ``odom`` message with the same stamp."""
    pose = estimate.pose
    return TransformStamped(
        header=Header(stamp=stamp, frame_id=settings.odom_frame),
        child_frame_id=settings.base_frame,
        transform=Transform(
            translation=Vector3(x=pose.x_m, y=pose.y_m, z=0.0),
            rotation=yaw_quaternion(pose.yaw_rad),
        ),
    )


def unturned(kinematics: Kinematics) -> Wheels:
    """Return the state of the wheels before any motion."""
    return Pose(), (0.0,) * len(kinematics.joints), ()


def turned(before: Wheels, estimate: OdometryEstimate, kinematics: Kinematics) -> Wheels:
    """Return the angles and rates of the wheels after the motion that ``estimate`` reports.

    ``before``: the state of the wheels before this motion.
    """
    rolled, rolling, (then, angles, _) = estimate.rolled, estimate.rolling, before
    way = BodyTwist(rolled.x_m - then.x_m, rolled.y_m - then.y_m, rolled.yaw_rad - then.yaw_rad)
    angles = tuple(map(add, angles, kinematics.wheel_rates(way)))
    return rolled, angles, kinematics.wheel_rates(rolling) if rolling else ()


def joint_state_message(wheels: Wheels, stamp: Time, settings: MessageSettings) -> JointState:
    """Return a ``joint_states`` message with wheel angles in rad and rates in rad/s."""
    _, angles, rates = wheels
    return JointState(
        header=Header(stamp=stamp), name=settings.wheels.joints, position=angles, velocity=rates
    )


def diagnostic_message(
    statuses: Sequence[Status], stamp: Time, node_name: str, hardware_id: str
) -> DiagnosticArray:
    """Return a ``/diagnostics`` message.

    Each status is named "node: status", as by diagnostic_updater.
    """
    return DiagnosticArray(
        header=Header(stamp=stamp),
        status=[
            DiagnosticStatus(
                level=bytes([status.level]),
                name=f"{node_name}: {status.name}",
                message=status.message,
                hardware_id=hardware_id,
                values=[KeyValue(key=key, value=value) for key, value in status.values.items()],
            )
            for status in statuses
        ],
    )


def raw_message(data: bytes) -> UInt8MultiArray:
    """Return a message of plain bytes, without a layout."""
    return UInt8MultiArray(data=array("B", data))


def time_message(nanoseconds: int) -> Time:
    """Return a stamp from nanoseconds since the clock's epoch."""
    return Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


def clock_offset(known_ns: int, before_ns: int, wall_ns: int, after_ns: int) -> int:
    """Return wall clock minus steady clock, in ns.

    ``wall_ns`` was read between the steady times ``before_ns`` and ``after_ns``. Of the possible
    values, the result is the nearest to ``known_ns``, the previous result.
    """
    return min(max(known_ns, wall_ns - after_ns), wall_ns - before_ns)


def yaw_quaternion(yaw_rad: float) -> Quaternion:
    """Return the quaternion of a rotation by ``yaw_rad`` about z."""
    return Quaternion(x=0.0, y=0.0, z=math.sin(yaw_rad / 2), w=math.cos(yaw_rad / 2))


def isotropic(stddev: float) -> list[float]:
    """Return the row-major 3x3 covariance of a vector with the same noise along each axis."""
    variance = stddev * stddev
    return [variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance]


def planar(
    xx: float, xy: float, x_yaw: float, yy: float, y_yaw: float, yaw_yaw: float
) -> list[float]:
    """Return the row-major 6x6 covariance of (x, y, z, roll, pitch, yaw) for planar motion."""
    zero, big = 0.0, UNMEASURED_VARIANCE
    return [
        *(xx, xy, zero, zero, zero, x_yaw),
        *(xy, yy, zero, zero, zero, y_yaw),
        *(zero, zero, big, zero, zero, zero),
        *(zero, zero, zero, big, zero, zero),
        *(zero, zero, zero, zero, big, zero),
        *(x_yaw, y_yaw, zero, zero, zero, yaw_yaw),
    ]


TWIST_NOT_KNOWN: Final = planar(
    UNMEASURED_VARIANCE, 0.0, 0.0, UNMEASURED_VARIANCE, 0.0, UNMEASURED_VARIANCE
)
