# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Serialise measurements to CDR, the format of DDS messages, and parse velocity commands from CDR.

CDR aligns numbers like a C struct on a 64-bit machine, so ``struct`` can write CDR quickly.
``difference`` checks this at each start: it compares the bytes with those that rclpy writes.
"""

import itertools
import math
import struct
from typing import Final

from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy._rclpy_pybind11 import RMWError
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import Imu, JointState

from omnibot_driver import command_messages, messages
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.core.odometry.covariance import UNKNOWN_YAW_VARIANCE, Covariance
from omnibot_driver.core.odometry.estimate import OdometryEstimate
from omnibot_driver.messages import MessageSettings, Wheels

LITTLE_ENDIAN: Final = b"\x00\x01\x00\x00"
"""First four bytes of every message in little-endian CDR. Alignment is counted from the byte after
these four bytes."""
STAMP: Final = "iI"
TWIST: Final = struct.Struct("<4s6d").unpack_from
NO_TURN: Final = (0.0, 0.0, 0.0, 1.0)
AT_REST: Final = (0.0,) * 6


class Serializer:
    """A fast serialiser of IMU, odometry and joint state messages, with fixed settings.

    In each method, ``stamp_ns`` is the stamp of the message, in ns since the epoch of the clock.
    """

    def __init__(self, settings: MessageSettings) -> None:
        frame, values = _text(settings.imu_frame)
        self._imu = struct.Struct(f"@{STAMP}{frame}37d")
        self._imu_head = (*values, *NO_TURN, *messages.NO_ORIENTATION)
        self._rate_noise = messages.isotropic(settings.angular_velocity_stddev)
        self._force_noise = messages.isotropic(settings.acceleration_stddev)

        odom_frame, odom_values = _text(settings.odom_frame)
        base_frame, base_values = _text(settings.base_frame)
        self._odometry = struct.Struct(f"@{STAMP}{odom_frame}{base_frame}85d")
        self._odometry_head = (*odom_values, *base_values)
        linear, angular = settings.twist_linear_stddev**2, settings.twist_angular_stddev**2
        self._twist_noise = messages.planar(linear, 0.0, 0.0, linear, 0.0, angular)

        texts = [_text(name) for name in settings.wheels.joints]
        names, name_values = [text[0] for text in texts], [text[1] for text in texts]
        no_frame, no_values = _text("")
        count = len(names)
        joints = f"@{STAMP}{no_frame}I{''.join(names)}I{count}d"
        self._joints = struct.Struct(f"{joints}I{count}dI")
        self._joints_at_odds = struct.Struct(f"{joints}II")
        self._joints_head = (*no_values, count, *itertools.chain(*name_values), count)

    def imu(self, estimate: ImuEstimate, stamp_ns: int) -> bytes:
        """Return the CDR bytes of an ``imu/data_raw`` message with this estimate and stamp."""
        return LITTLE_ENDIAN + self._imu.pack(
            *divmod(stamp_ns, 10**9),
            *self._imu_head,
            *estimate.angular_velocity,
            *self._rate_noise,
            *estimate.specific_force,
            *self._force_noise,
        )

    def odometry(self, estimate: OdometryEstimate, stamp_ns: int) -> bytes:
        """Return the CDR bytes of an ``odom`` message with this estimate and stamp."""
        pose, twist, noise = estimate.pose, estimate.twist, estimate.covariance
        if noise.yaw_yaw > UNKNOWN_YAW_VARIANCE:  # else the call would change nothing
            noise = noise.of_direction
        half_rad = pose.yaw_rad / 2
        moving, twist_noise = AT_REST, messages.TWIST_NOT_KNOWN
        if twist is not None:
            moving = (twist.vx_mps, twist.vy_mps, 0.0, 0.0, 0.0, twist.yaw_rate_radps)
            twist_noise = self._twist_noise
            if estimate.twist_variances is not None:
                speed, turning = estimate.twist_variances
                twist_noise = messages.planar(speed, 0.0, 0.0, speed, 0.0, turning)
        return LITTLE_ENDIAN + self._odometry.pack(
            *divmod(stamp_ns, 10**9),
            *self._odometry_head,
            *(pose.x_m, pose.y_m, 0.0),
            *(0.0, 0.0, math.sin(half_rad), math.cos(half_rad)),
            *messages.planar(noise.xx, noise.xy, noise.x_yaw, noise.yy, noise.y_yaw, noise.yaw_yaw),
            *moving,
            *twist_noise,
        )

    def joint_state(self, wheels: Wheels, stamp_ns: int) -> bytes:
        """Return the CDR bytes of a ``joint_states`` message with this wheel state and stamp."""
        _, angles, rates = wheels
        head = (*divmod(stamp_ns, 10**9), *self._joints_head, *angles)
        if rates:
            return LITTLE_ENDIAN + self._joints.pack(*head, len(rates), *rates, 0)
        return LITTLE_ENDIAN + self._joints_at_odds.pack(*head, 0, 0)


def twist(data: bytes) -> tuple[BodyTwist, bool]:
    """Return the planar part of a serialised Twist, and whether all other parts are zero.

    Raises CommandRefused for NaN or infinity, or if the bytes are not a Twist.
    """
    try:
        encapsulation, x, y, z, roll, pitch, yaw = TWIST(data)
        finite = 0.0 * x * y * z * roll * pitch * yaw == 0.0  # otherwise the product is NaN
        if finite and encapsulation == LITTLE_ENDIAN:
            return BodyTwist(x, y, yaw), not (z or roll or pitch)
        message = deserialize_message(data, Twist)
        return command_messages.body_twist(message), command_messages.is_planar(message)
    except (RMWError, struct.error) as error:
        raise CommandRefused(
            f"cmd_vel rejected: not a valid Twist ({error}); fix the publishing node"
        ) from error


def is_zero(data: bytes) -> bool:
    """Return whether the planar part of a serialised Twist is zero.

    Raises CommandRefused in the same cases as ``twist``.
    """
    return twist(data)[0] == command_messages.AT_REST


class Messages:
    """A replacement for Serializer that returns rclpy messages instead of CDR bytes.

    The driver uses it if the bytes from Serializer differ from those from rclpy.
    """

    def __init__(self, settings: MessageSettings) -> None:
        self._settings = settings

    def imu(self, estimate: ImuEstimate, stamp_ns: int) -> Imu:
        """Return a message for ``imu/data_raw``."""
        return messages.imu_message(estimate, messages.time_message(stamp_ns), self._settings)

    def odometry(self, estimate: OdometryEstimate, stamp_ns: int) -> Odometry:
        """Return a message for ``odom``."""
        return messages.odometry_message(estimate, messages.time_message(stamp_ns), self._settings)

    def joint_state(self, wheels: Wheels, stamp_ns: int) -> JointState:
        """Return a message for ``joint_states``."""
        return messages.joint_state_message(wheels, messages.time_message(stamp_ns), self._settings)


def difference(settings: MessageSettings) -> str:
    """Return the name of a message type that Serializer writes differently from rclpy.

    The result is empty if Serializer writes all types like rclpy.
    """
    reading = ImuEstimate(0.0, (1.1, -2.2, 3.3), (-4.4, 5.5, -6.6))
    noise = Covariance(1.2, 2.3, 3.4, 4.5, 5.6, 6.7)
    tangent, twist = Pose(7.7, -8.8, 9.9), BodyTwist(0.1, -0.2, 0.3)
    estimates = [OdometryEstimate(0.0, tangent, known, noise) for known in (twist, None)]
    angles = tuple(10.1 + number for number in range(len(settings.wheels.joints)))
    joints: list[Wheels] = [(tangent, angles, rates) for rates in (angles, ()) if angles]
    stamp_ns = 1_234_567_890_987_654_321
    pairs = zip(
        *(
            [
                make.imu(reading, stamp_ns),
                *(make.odometry(estimate, stamp_ns) for estimate in estimates),
                *(make.joint_state(wheels, stamp_ns) for wheels in joints),
            ]
            for make in (Messages(settings), Serializer(settings))
        ),
        strict=True,
    )
    for message, ours in pairs:
        if not _same(ours, serialize_message(message), type(message)):
            return type(message).__name__
    return ""


def _same(ours: bytes, theirs: bytes, kind: type) -> bool:
    """Return whether two serialisations contain the same message.

    Padding is ignored, because rclpy leaves arbitrary bytes in the padding and after the end.
    """
    try:
        alike = deserialize_message(ours, kind) == deserialize_message(theirs, kind)
    except RMWError:
        return False
    return alike and len(ours) <= len(theirs)


def _text(text: str) -> tuple[str, tuple[int, bytes]]:
    """Return the ``struct`` format of a CDR string, and the values to pack: length and bytes."""
    data = text.encode() + b"\0"
    return f"I{len(data)}s", (len(data), data)
