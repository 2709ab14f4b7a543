# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Record the topics of a driver to a bag, as ``ros2 bag record`` does, and read bags."""

import importlib
from functools import partial
from pathlib import Path
from typing import Any, Final

from probe import Probe
from rclpy.duration import Duration
from rclpy.node import NodeNameNonExistentError
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

TYPES: Final = get_typestore(Stores.ROS2_JAZZY)
DEPTH: Final = 1000

Message = tuple[int, bytes]
"""The time at which a message arrived, in ns, and the serialised message."""


def message_class(name: str) -> type:
    package, _, kind = name.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), kind)  # type: ignore[no-any-return]


def as_recorded(qos: QoSProfile) -> Qos:
    """Convert a quality of service from rclpy's type to the type that bags use."""
    return Qos(
        QosHistory[qos.history.name],
        qos.depth,
        QosReliability[qos.reliability.name],
        QosDurability[qos.durability.name],
        _time(qos.deadline),
        _time(qos.lifespan),
        QosLiveliness[qos.liveliness.name],
        _time(qos.liveliness_lease_duration),
        qos.avoid_ros_namespace_conventions,
    )


def as_played(qos: Qos) -> QoSProfile:
    """Convert the quality of service from a bag to rclpy's type.

    A publisher or a subscription can use the result.
    """
    return QoSProfile(
        depth=DEPTH,
        reliability=ReliabilityPolicy[qos.reliability.name],
        durability=DurabilityPolicy[qos.durability.name],
    )


def _time(duration: Duration) -> QosTime:
    return QosTime(*divmod(duration.nanoseconds, 10**9))


class Recorder:
    """Records all topics that a driver publishes. The topics are found at run time.

    ``types``: the message type of each topic, such as "nav_msgs/msg/Odometry".

    ``offered``: the quality of service that the driver offers on each topic.
    """

    def __init__(self, probe: Probe) -> None:
        self.messages: dict[str, list[Message]] = {}
        self.types: dict[str, str] = {}
        self.offered: dict[str, Qos] = {}
        self._probe = probe

    def record(self, *expected: str) -> None:
        """Wait until the driver publishes the ``expected`` topics.

        Then subscribe to all its topics.
        """
        namespace = self._probe.node.get_namespace()

        def publishes() -> bool:
            try:
                found = self._probe.node.get_publisher_names_and_types_by_node(
                    "omnibot_driver", namespace
                )
            except NodeNameNonExistentError:
                return False
            self.types = {topic: kind for topic, (kind,) in found}
            return {f"{namespace}/{name}" for name in expected} <= set(self.types)

        self._probe.wait_for_graph(publishes)
        for topic, kind in self.types.items():
            (offer,) = [
                info
                for info in self._probe.node.get_publishers_info_by_topic(topic)
                if (info.node_name, info.node_namespace) == ("omnibot_driver", namespace)
            ]
            self.offered[topic] = as_recorded(offer.qos_profile)
            self.hear(topic, kind, as_played(self.offered[topic]))

    def hear(self, topic: str, kind: str, qos: QoSProfile) -> list[Message]:
        """Subscribe to a topic, and return the list to which its messages are appended."""
        heard = self.messages.setdefault(topic, [])
        self._probe.listen_raw(message_class(kind), topic, qos, partial(_append, heard))
        return heard

    def write(self, path: Path, plugin: StoragePlugin) -> None:
        """Write the messages received so far to a bag."""
        with Writer(path, version=9, storage_plugin=plugin) as writer:
            for topic, messages in self.messages.items():
                connection = writer.add_connection(
                    topic,
                    self.types[topic],
                    typestore=TYPES,
                    offered_qos_profiles=[self.offered[topic]],
                )
                for at_ns, data in messages:
                    writer.write(connection, at_ns, data)


def _append(heard: list[Message], data: bytes, info: dict[str, int]) -> None:
    heard.append((info["received_timestamp"], data))


def read(path: Path) -> tuple[dict[str, list[Message]], dict[str, Qos]]:
    """Return the messages of a bag by topic, and the quality of service offered on each topic."""
    with Reader(path) as bag:
        offered = {item.topic: item.ext.offered_qos_profiles[0] for item in bag.connections}
        messages: dict[str, list[Message]] = {topic: [] for topic in offered}
        for connection, at_ns, data in bag.messages():
            messages[connection.topic].append((at_ns, bytes(data)))
    return messages, offered


def equal(ours: Any, theirs: Any) -> bool:
    """Return whether a message from rclpy and one from rosbags have equal fields."""
    if hasattr(ours, "get_fields_and_field_types"):
        names = ours.get_fields_and_field_types()
        return all(equal(getattr(ours, name), getattr(theirs, name)) for name in names)
    if isinstance(ours, bytes):  # what ROS calls a byte
        return ours == bytes([theirs])
    if isinstance(ours, str | int | float):
        return bool(ours == theirs)
    return len(ours) == len(theirs) and all(
        equal(mine, his) for mine, his in zip(ours, theirs, strict=True)
    )
