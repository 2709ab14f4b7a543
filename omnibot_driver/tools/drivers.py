# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Finds running drivers of any board by the topics that every driver publishes."""

import os
from collections.abc import Iterable, Mapping
from typing import Any, Final

SIGNS: Final = {"state": "std_msgs/msg/String", "estop_active": "std_msgs/msg/Bool"}
"""Topics that every driver publishes in its own namespace, with their types. A node that publishes
all of them is regarded as a driver."""


def drivers_among(topics: Iterable[tuple[str, str]]) -> list[str]:
    """Return the full names of the nodes that have all topics of SIGNS among ``topics``.

    ``topics``: pairs of a topic's name and its type.
    """
    pairs = set(topics)
    names = {topic.rpartition("/")[0] for topic, _kind in pairs}
    return sorted(
        name
        for name in names
        if name and all((f"{name}/{sign}", kind) in pairs for sign, kind in SIGNS.items())
    )


def running_drivers(node: Any) -> list[str]:
    """Return the full names of the drivers that publish now and that ``node`` has discovered."""
    found = node.get_topic_names_and_types()
    return [
        name
        for name in drivers_among((topic, kind) for topic, kinds in found for kind in kinds)
        if all(node.count_publishers(f"{name}/{sign}") for sign in SIGNS)
    ]


def discovery_advice(environment: Mapping[str, str] = os.environ) -> str:
    """Return advice to append to the message that no driver was found; usually empty.

    With a discovery server, only a super client can list the running drivers.
    """
    if not environment.get("ROS_DISCOVERY_SERVER"):
        return ""
    if environment.get("ROS_SUPER_CLIENT", "").upper() in ("TRUE", "1"):
        return ""
    return "; because ROS_DISCOVERY_SERVER is set, this tool also needs ROS_SUPER_CLIENT=TRUE"
