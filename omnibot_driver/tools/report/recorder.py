# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Converts messages to columns of numbers.

Messages from a bag and from rclpy have the same fields.
"""

import math
from array import array
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from omnibot_driver.core.geometry.quaternion import yaw_of
from omnibot_driver.tools.drivers import SIGNS
from omnibot_driver.tools.report.log import Log, Series, Span, Status

NO_STAMP: Final = -1
WHEEL: Final = "wheel"
"""Part of the name of each wheel's joint. The names of other joints do not contain it."""
DIAGNOSTICS: Final = "/diagnostics"

Row = tuple[float, ...]


def _imu(message: Any) -> Row:
    rate, force = message.angular_velocity, message.linear_acceleration
    return rate.x, rate.y, rate.z, force.x, force.y, force.z


def _odometry(message: Any) -> Row:
    pose, twist = message.pose.pose, message.twist.twist
    turn = pose.orientation
    yaw_rad = yaw_of(turn.x, turn.y, turn.z, turn.w)
    return (
        *(pose.position.x, pose.position.y, yaw_rad),
        *(twist.linear.x, twist.linear.y, twist.angular.z),
    )


def _twist(message: Any) -> Row:
    return message.linear.x, message.linear.y, message.angular.z


def _wheels(message: Any) -> Row:
    return tuple(message.data)


@dataclass(frozen=True, slots=True)
class Role:
    """How the messages of a topic are converted to rows of numbers.

    * ``width``: number of values in a row; None: one for each wheel.
    * ``read``: functions that convert a message to a row, by message type.
    """

    width: int | None
    read: Mapping[str, Callable[[Any], Row]]


SERIES: Final = {
    "imu/data_raw": Role(6, {"sensor_msgs/msg/Imu": _imu}),
    "odom": Role(6, {"nav_msgs/msg/Odometry": _odometry}),
    "joint_states": Role(None, {"sensor_msgs/msg/JointState": lambda _message: ()}),
    "cmd_vel": Role(
        3,
        {
            "geometry_msgs/msg/Twist": _twist,
            "geometry_msgs/msg/TwistStamped": lambda message: _twist(message.twist),
        },
    ),
    "wheel_cmd": Role(None, {"std_msgs/msg/Float32MultiArray": _wheels}),
}
EVENTS: Final = {
    **SIGNS,
    DIAGNOSTICS: "diagnostic_msgs/msg/DiagnosticArray",
}


class _Column:
    def __init__(self, role: Role) -> None:
        self.role = role
        self.arrived_ns, self.stamp_ns, self.values = array("q"), array("q"), array("d")
        self.rows: list[Row] = []
        """Rows of values; used only if the topic has one value for each wheel. The number of wheels
        becomes known only at the end of the recording."""

    def hear(self, row: Row, arrived_ns: int, message: Any) -> None:
        header = getattr(message, "header", None)
        stamp_ns = header.stamp.sec * 10**9 + header.stamp.nanosec if header else 0
        if self.role.width is None:
            self.rows.append(row)
        else:
            self.values.extend(row)
        self.arrived_ns.append(arrived_ns)
        self.stamp_ns.append(stamp_ns or NO_STAMP)

    def series(self, start_ns: int, wheels: int) -> Series:
        """Return the messages of this topic as a series, in the order of arrival.

        ``start_ns``: the time at which the log begins. ``wheels``: number of wheels, 0 if unknown.
        """
        arrived_ns, stamp_ns = (
            np.array(column, dtype=np.int64) for column in (self.arrived_ns, self.stamp_ns)
        )
        stamp_s = np.where(stamp_ns == NO_STAMP, np.nan, (stamp_ns - start_ns) / 1e9)
        if self.role.width is None:
            usual = Counter(map(len, self.rows)).most_common(1)
            width = wheels or (usual[0][0] if usual else 0)
            whole = [row if len(row) == width else (math.nan,) * width for row in self.rows]
            values = np.array(whole, dtype=np.float64).reshape(len(whole), width)
        else:
            values = np.array(self.values).reshape(-1, self.role.width)
        order = np.argsort(arrived_ns, kind="stable")
        return Series((arrived_ns[order] - start_ns) / 1e9, stamp_s[order], values[order])


class Recorder:
    """A collector of one robot's messages.

    ``hear`` records a message. At the end, ``log`` returns all of them.
    """

    def __init__(self, robot: str) -> None:
        self._robot = robot
        self._columns = {name: _Column(role) for name, role in SERIES.items()}
        self._events: dict[str, list[tuple[int, Any]]] = {name: [] for name in EVENTS}
        self._wheels: tuple[str, ...] = ()
        self.count = 0

    def hear(self, role: str, kind: str, arrived_ns: int, message: Any) -> None:
        """Record a message that arrived on a topic.

        ``role``: the topic's name without its namespace, such as ``odom`` or ``state``.
        ``kind``: message type of the topic.
        """
        if role in self._columns:
            column = self._columns[role]
            joints = role == "joint_states"
            row = self._rates(message) if joints else column.role.read[kind](message)
            column.hear(row, arrived_ns, message)
        elif role == DIAGNOSTICS:
            self._events[role].append((arrived_ns, message.status))
        else:
            self._events[role].append((arrived_ns, message.data))
        self.count += 1

    def _rates(self, message: Any) -> Row:
        """Return the rates of the wheels, in the order of the names in the first message."""
        self._wheels = self._wheels or tuple(name for name in message.name if WHEEL in name)
        rates = dict(zip(message.name, message.velocity, strict=False))
        return tuple(rates.get(wheel, math.nan) for wheel in self._wheels)

    def log(
        self, troubles: tuple[str, ...] = (), *, topics: Iterable[str] = (), alone: bool = True
    ) -> Log:
        """Return a log of all messages, in the order of arrival.

        ``topics``: names, without namespace, of the topics that exist. Empty if unknown.

        There must be at least one message.
        """
        times = [
            *(time for column in self._columns.values() for time in column.arrived_ns),
            *(time for events in self._events.values() for time, _ in events),
        ]
        start_ns, end_s = min(times), (max(times) - min(times)) / 1e9
        for events in self._events.values():
            events.sort(key=lambda event: event[0])
        series = {
            name: column.series(start_ns, len(self._wheels))
            for name, column in self._columns.items()
        }
        absent = tuple(name for name in SERIES if not len(series[name]))
        return Log(
            robot=self._robot,
            start_ns=start_ns,
            duration_s=end_s,
            imu=series["imu/data_raw"],
            odom=series["odom"],
            joint_states=series["joint_states"],
            cmd_vel=series["cmd_vel"],
            wheel_cmd=series["wheel_cmd"],
            wheels=self._wheels,
            states=self._spans("state", start_ns, end_s, str),
            estops=self._spans(
                "estop_active", start_ns, end_s, lambda on: "latched" if on else "free"
            ),
            diagnostics=self._statuses(start_ns),
            absent=(*absent, *(name for name, events in self._events.items() if not events)),
            topics=tuple(topics),
            troubles=troubles,
            alone=alone,
        )

    def _spans(
        self, role: str, start_ns: int, end_s: float, name: Callable[[Any], str]
    ) -> tuple[Span, ...]:
        """Return the spans of time in which a topic's value, converted to text, stayed the same.

        ``name``: function that converts a value to its text, which becomes ``Span.what``.
        """
        spans: list[Span] = []
        for arrived_ns, value in self._events[role]:
            at_s, what = (arrived_ns - start_ns) / 1e9, name(value)
            if spans and spans[-1].what == what:
                continue
            if spans:
                spans[-1] = Span(spans[-1].begin_s, at_s, spans[-1].what)
            spans.append(Span(at_s, end_s, what))
        return tuple(spans)

    def _statuses(self, start_ns: int) -> tuple[Status, ...]:
        return tuple(
            Status(
                (arrived_ns - start_ns) / 1e9,
                status.hardware_id,
                status.name,
                status.level if isinstance(status.level, int) else status.level[0],
                status.message,
                {pair.key: pair.value for pair in status.values},
            )
            for arrived_ns, statuses in self._events[DIAGNOSTICS]
            for status in statuses
        )
