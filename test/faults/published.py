# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Compares published messages with the frames that the board sent.

Messages and frames are converted to *keys*, which have the values in the units of the frame.
"""

import math
import struct
from collections.abc import Iterable
from typing import Final

from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu

from omnibot_driver.messages import UNMEASURED_VARIANCE


def stamp_s(message: Imu | Odometry) -> float:
    return message.header.stamp.sec + message.header.stamp.nanosec * 1e-9


Key = tuple[float, ...]
_ACCEL: Final = 9.80665 / 16384
_GYRO: Final = math.radians(1 / 131)


def imu_key(message: Imu) -> Key:
    """Return the reading of a message, converted to counts of the sensor."""
    a, w = message.linear_acceleration, message.angular_velocity
    return a.x / _ACCEL, a.y / _ACCEL, a.z / _ACCEL, w.x / _GYRO, w.y / _GYRO, w.z / _GYRO


def sent_imu_key(frame: bytes) -> Key | None:
    return struct.unpack(">6h", frame[2:]) if frame[:2] == b"\xff\xfa" else None


def odom_key(message: Odometry) -> Key | None:
    """Return the speed in 0.1 mm per 40 ms, and the yaw rate in 0.1 mrad per 40 ms.

    Return None if the twist was not measured. The key does not depend on the robot's heading.
    """
    v = message.twist.twist
    unknown = message.twist.covariance[0] >= UNMEASURED_VARIANCE
    return None if unknown else (math.hypot(v.linear.x, v.linear.y) * 400.0, v.angular.z * 400.0)


def sent_odom_key(frame: bytes) -> Key | None:
    if frame[:2] != b"\xff\xfb":
        return None
    dx, dy, dtheta = struct.unpack(">3h", frame[2:8])
    return math.hypot(dx, dy), dtheta


def not_sent(published: Iterable[Key | None], sent: Iterable[Key | None]) -> int:
    """Return how many published messages the board has not sent, or has sent in another order.

    ``published``, ``sent``: the values of each message or frame, in the frame's units. None is
    skipped.
    """
    truth = [key for key in sent if key is not None]
    at = missing = 0
    for key in published:
        if key is None:
            continue
        place = next((n for n in range(at, len(truth)) if same(key, truth[n])), None)
        if place is None:
            missing += 1
        else:
            at = place + 1
    return missing


def same(published: Key, sent: Key) -> bool:
    return all(abs(a - b) < 0.5 for a, b in zip(published, sent, strict=True))
