# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Synthetic recordings of a drive, as a log or as a ROS bag. Tests can plant faults in them."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from omnibot_driver.tools.report.log import Log, Series, Span, Status

TYPES = get_typestore(Stores.ROS2_JAZZY)
START_NS = 1_790_000_000_000_000_000
WHEELS = tuple(f"wheel_{wheel}_joint" for wheel in "abc")
REST_S = 4.0
"""Time at rest at the beginning and at the end of a drive, in s."""
DELAY_S = 0.1
"""Delay from a command to the measured motion, in s."""

Array = NDArray[np.float64]


def message(kind: str, *values: Any) -> Any:
    """Return a ROS message whose fields have these values, in order.

    A tuple is a nested message.
    """
    fields = TYPES.fielddefs[kind][1]
    filled = []
    for (_, (node, detail)), value in zip(fields, values, strict=True):
        inner = detail if node.name == "NAME" else None
        filled.append(message(inner, *value) if isinstance(inner, str) else value)
    return TYPES.types[kind](*filled)


@dataclass
class Topic:
    """The messages of one topic. A message arrives ``late_s`` seconds after its timestamp."""

    stamp_s: Array
    values: Array
    late_s: Array

    def series(self) -> Series:
        """Return the messages as a series in order of arrival."""
        arrived_s = self.stamp_s + self.late_s
        order = np.argsort(arrived_s)
        return Series(arrived_s[order], self.stamp_s[order], self.values[order])

    def drop(self, begin_s: float, end_s: float) -> None:
        """Remove the messages from ``begin_s`` to ``end_s``, as if they were lost.

        The times are timestamps, in s.
        """
        kept = (self.stamp_s < begin_s) | (self.stamp_s >= end_s)
        self.stamp_s, self.late_s = self.stamp_s[kept], self.late_s[kept]
        self.values = self.values[kept]


def _ticks(seconds: float, rate_hz: float) -> Array:
    return np.arange(0.0, seconds, 1.0 / rate_hz)


@dataclass
class Drive:
    """A recording of a healthy robot that rests, drives along a curve, and rests again.

    ``namespace``: the prefix of its topics, such as ``/robot1``.
    """

    seconds: float = 20.0
    namespace: str = ""
    seed: int = 1
    states: list[tuple[float, str]] = field(default_factory=lambda: [(0.0, "nominal")])
    estops: list[tuple[float, bool]] = field(default_factory=lambda: [(0.0, False)])
    statuses: list[tuple[float, str, int, str, dict[str, str]]] = field(default_factory=list)
    stamped_commands: bool = False

    def __post_init__(self) -> None:
        random = np.random.default_rng(self.seed)
        times_s = _ticks(self.seconds, 100.0)
        twist = self.told(times_s - DELAY_S)
        gyro = np.zeros((len(times_s), 3))
        gyro[:, 2] = -twist[:, 2]
        force = np.tile([0.0, 0.0, -9.80665], (len(times_s), 1))
        noise = random.normal(0.0, [1e-3] * 3 + [0.03] * 3, (len(times_s), 6))
        self.imu = self._topic(random, times_s, np.hstack([gyro, force]) + noise)
        heading = np.cumsum(twist[:, 2]) / 100.0
        x = np.cumsum(twist[:, 0] * np.cos(heading) - twist[:, 1] * np.sin(heading)) / 100.0
        y = np.cumsum(twist[:, 0] * np.sin(heading) + twist[:, 1] * np.cos(heading)) / 100.0
        rows = np.column_stack([x, y, heading, twist])[::4]
        self.odom = self._topic(random, times_s[::4], rows)
        self.joints = self._topic(random, times_s[::4], np.zeros((len(rows), 3)))
        commands_s = _ticks(self.seconds, 10.0)
        self.cmd_vel = self._topic(random, commands_s, self.told(commands_s))
        for at_s in _ticks(self.seconds, 1.0):
            lost = {"IMU frames lost": "7", "Odometry frames lost": "0"}
            self.statuses.append((at_s, "omnibot_driver: Stream", 0, "complete", lost))

    def told(self, times_s: Array) -> Array:
        """Return the commanded vx, vy (m/s) and yaw rate (rad/s), with one row for each time."""
        on = (times_s >= REST_S) & (times_s < self.seconds - REST_S)
        wave = np.sin(2 * np.pi * (times_s - REST_S) / 6.0)
        return np.column_stack([0.25 + 0.0 * wave, 0.1 * wave, 0.4 + 0.0 * wave]) * on[:, None]

    def _topic(self, random: np.random.Generator, stamp_s: Array, values: Array) -> Topic:
        return Topic(stamp_s, values, 0.001 + random.exponential(3e-4, len(stamp_s)))

    def messages(self) -> list[tuple[str, str, int, Any]]:
        """Return all messages in order of arrival.

        Each item is the topic, the type, the time of arrival in ns, and the content.
        """
        name, found = self.namespace, []

        def add(topic: str, kind: str, arrived_s: float, *values: Any) -> None:
            arrived_ns = START_NS + round(1e9 * arrived_s)
            found.append((topic, kind, arrived_ns, message(kind, *values)))

        cov9, cov36 = np.zeros(9), np.zeros(36)
        for at_s, row, late_s in self._rows(self.imu):
            rate, force = tuple(row[:3]), tuple(row[3:])
            turn = (0.0, 0.0, 0.0, 1.0)
            add(
                *(f"{name}/imu/data_raw", "sensor_msgs/msg/Imu", at_s + late_s),
                *(header(at_s, "imu_link"), turn, cov9, rate, cov9, force, cov9),
            )
        for at_s, (x, y, yaw, vx, vy, rate), late_s in self._rows(self.odom):
            pose = ((x, y, 0.0), (0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)))
            add(
                *(f"{name}/odom", "nav_msgs/msg/Odometry", at_s + late_s),
                *(header(at_s, "odom"), "base_link", (pose, cov36)),
                (((vx, vy, 0.0), (0.0, 0.0, rate)), cov36),
            )
        for at_s, row, late_s in self._rows(self.joints):
            add(
                *(f"{name}/joint_states", "sensor_msgs/msg/JointState", at_s + late_s),
                *(header(at_s, ""), list(WHEELS), np.array(row), np.array(row), np.zeros(0)),
            )
        kind = f"geometry_msgs/msg/Twist{'Stamped' if self.stamped_commands else ''}"
        for at_s, (vx, vy, rate), late_s in self._rows(self.cmd_vel):
            twist = ((vx, vy, 0.0), (0.0, 0.0, rate))
            values = (header(at_s, ""), twist) if self.stamped_commands else twist
            add(f"{name}/cmd_vel", kind, at_s + late_s, *values)
        for at_s, state in self.states:
            add(f"{name}/omnibot_driver/state", "std_msgs/msg/String", at_s, state)
        for at_s, on in self.estops:
            add(f"{name}/omnibot_driver/estop_active", "std_msgs/msg/Bool", at_s, on)
        for at_s, status, level, text, values in self.statuses:
            pairs = [message("diagnostic_msgs/msg/KeyValue", *pair) for pair in values.items()]
            told = message(
                "diagnostic_msgs/msg/DiagnosticStatus", level, status, text, "/dev/ttyUSB0", pairs
            )
            add(
                *("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", at_s),
                *(header(at_s, ""), [told]),
            )
        return sorted(found, key=lambda item: item[2])

    @staticmethod
    def _rows(topic: Topic) -> Any:
        return zip(topic.stamp_s, topic.values.tolist(), topic.late_s, strict=True)

    def log(self) -> Log:
        """Return this drive as the log that the report would read from a bag."""
        end_s = self.seconds
        nothing = Series(np.empty(0), np.empty(0), np.empty((0, 3)))
        series = [topic.series() for topic in (self.imu, self.odom, self.joints, self.cmd_vel)]
        names = ("imu/data_raw", "odom", "joint_states", "cmd_vel")
        return Log(
            robot=self.namespace or "/",
            start_ns=START_NS,
            duration_s=end_s,
            imu=series[0],
            odom=series[1],
            joint_states=series[2],
            cmd_vel=series[3],
            wheel_cmd=nothing,
            wheels=WHEELS,
            states=spans(self.states, end_s),
            estops=spans([(at, "latched" if on else "free") for at, on in self.estops], end_s),
            diagnostics=tuple(Status(at_s, "/dev/ttyUSB0", *rest) for at_s, *rest in self.statuses),
            absent=tuple(name for name, found in zip(names, series, strict=True) if not len(found)),
        )


def spans(changes: list[tuple[float, str]], end_s: float) -> tuple[Span, ...]:
    """Return the time spans between changes of a state. The last span ends at ``end_s``."""
    times_s = [at_s for at_s, _ in changes] + [end_s]
    return tuple(
        Span(at_s, until_s, what)
        for (at_s, what), until_s in zip(changes, times_s[1:], strict=True)
    )


def header(at_s: float, frame: str) -> tuple[tuple[int, int], str]:
    """Return a message header: the timestamp as seconds and nanoseconds, and the frame."""
    return divmod(START_NS + round(1e9 * at_s), 10**9), frame


def write(
    path: Path,
    drives: Sequence[Drive],
    plugin: StoragePlugin = StoragePlugin.MCAP,
    compression: CompressionMode = CompressionMode.NONE,
) -> Path:
    """Write a bag of these drives, and return its path."""
    messages = sorted((item for drive in drives for item in drive.messages()), key=lambda i: i[2])
    writer = Writer(path, version=9, storage_plugin=plugin)
    if compression is not CompressionMode.NONE:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        connections: dict[str, Any] = {}
        for topic, kind, arrived_ns, told in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=TYPES)
            data = TYPES.serialize_cdr(told, kind)
            writer.write(connections[topic], arrived_ns, data)
    return path
