# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Conversion of the ROS messages that command the robot: pure functions without a node."""

import math
from typing import Any, Final

from builtin_interfaces.msg import Time
from geometry_msgs.msg import TwistStamped

from omnibot_driver.core.commands.limits import require_finite
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.geometry.quaternion import yaw_of
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist

SHORTEST_QUATERNION: Final = 1e-3
AT_REST: Final = BodyTwist(0.0, 0.0, 0.0)
MOST_TILT_RAD: Final = 0.1


def body_twist(twist: Any) -> BodyTwist:
    """Return the planar part of a geometry_msgs/Twist, in m/s and rad/s.

    Raises CommandRefused if any of the six values is NaN or infinity.
    """
    linear, angular = twist.linear, twist.angular
    require_finite("cmd_vel", (linear.x, linear.y, linear.z, angular.x, angular.y, angular.z))
    return BodyTwist(linear.x, linear.y, angular.z)


def is_zero(twist: Any) -> bool:
    """Return whether the planar part of a geometry_msgs/Twist is zero.

    Raises CommandRefused if any of the six values is NaN or infinity.
    """
    return body_twist(twist) == AT_REST


def is_planar(twist: Any) -> bool:
    """Return whether a geometry_msgs/Twist has no velocity out of the plane."""
    return not (twist.linear.z or twist.angular.x or twist.angular.y)


def goal_pose(stamped: Any, odom_frame: str) -> Pose:
    """Return the planar pose of a geometry_msgs/PoseStamped; z is ignored.

    Raises CommandRefused for another frame, NaN or infinity, a tilt, or a quaternion whose length
    is far from 1.
    """
    frame, position, turn = stamped.header.frame_id, stamped.pose.position, stamped.pose.orientation
    if frame not in ("", odom_frame):
        raise CommandRefused(
            f"cmd_pose rejected: it is given in '{frame}'; transform it to '{odom_frame}' first"
        )
    quaternion = (turn.x, turn.y, turn.z, turn.w)
    require_finite("cmd_pose", (position.x, position.y, position.z, *quaternion))
    length = math.hypot(*quaternion)
    if not SHORTEST_QUATERNION < length < 1.0 / SHORTEST_QUATERNION:
        raise CommandRefused(
            f"cmd_pose rejected: its orientation is not a unit quaternion (length {length:g}); for"
            " no rotation set w to 1"
        )
    x, y, z, w = (part / length for part in quaternion)
    upright = 1.0 - 2.0 * (x * x + y * y)
    if upright < math.cos(MOST_TILT_RAD):
        tilt_deg = math.degrees(math.acos(max(-1.0, upright)))
        raise CommandRefused(
            f"cmd_pose rejected: its orientation is tilted by {tilt_deg:.0f}°; this robot turns"
            " about z only"
        )
    return Pose(position.x, position.y, yaw_of(x, y, z, w))


def age(stamp: Time, now_ns: int) -> float:
    """Return the age of a stamp, in s. A stamp of zero has the age 0.

    ``now_ns``: current time of the stamp's clock, in ns.
    """
    stamp_ns = stamp.sec * 10**9 + stamp.nanosec
    return (now_ns - stamp_ns) / 1e9 if stamp_ns else 0.0


def is_stamped(stamped: TwistStamped) -> bool:
    """Return whether the sender has set the stamp. Zero means that it is not set."""
    stamp = stamped.header.stamp
    return bool(stamp.sec or stamp.nanosec)
