# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Advice on what disturbs the driver: settings of the computer, parameter files, and other nodes.

This module does not use pyserial, ROS or a board.
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import yaml

from omnibot_driver.core.timing import clock_fit

SYSFS: Final = Path("/sys")
LONGEST_LATENCY_MS: Final = 5
"""Longest acceptable latency timer, in ms: half the sampling period of an OmniBot. FTDI's default
is 16 ms, its minimum 1 ms."""
RECORDING: Final = "replay://"
WITHOUT_CLOCK: Final = ("sim://", RECORDING)
"""URL schemes of ports without a real robot. With them, the driver accepts simulated time."""


def core_kind() -> str:
    """Return ``compiled`` if the core's compilable modules are compiled, else ``interpreted``."""
    return "interpreted" if clock_fit.__file__.endswith(".py") else "compiled"


def latency_advice(port: str, sysfs: Path = SYSFS) -> str:
    """Return a warning if the latency timer of the USB adapter is too long; otherwise empty."""
    device = Path(port).resolve().name
    try:
        text = (sysfs / "class/tty" / device / "device/latency_timer").read_text(encoding="ascii")
        latency_ms = int(text)
    except (OSError, ValueError):
        return ""
    if latency_ms <= LONGEST_LATENCY_MS:
        return ""
    return (
        f"the USB adapter of {port} holds bytes for {latency_ms} ms (its latency_timer), so"
        " measurements arrive in bursts; install udev/99-omnibot.rules, or run this after each"
        f" time you plug it in: echo 1 | sudo tee /sys/class/tty/{device}/device/latency_timer"
    )


def clock_advice(port: str, use_sim_time: bool) -> str:
    """Return a warning if the node uses simulated time although the board is real; else empty."""
    if not use_sim_time or port.lower().startswith(WITHOUT_CLOCK):
        return ""
    return (
        f"use_sim_time is set, but the board on {port} runs in real time, so stamps and the age of"
        " commands will be wrong; start the driver with use_sim_time:=false"
    )


def waiting_advice(port: str, now_ns: int) -> str:
    """Return a warning if the node's clock, ``now_ns``, is still 0; otherwise empty.

    The result is also empty for a recording, which needs no clock.
    """
    if now_ns or port.lower().startswith(RECORDING):
        return ""
    return (
        "use_sim_time is set but nothing publishes /clock, so no measurements are published; start"
        " the publisher of /clock, or start the driver with use_sim_time:=false"
    )


def prefix_advice(prefix: str) -> str:
    """Return a warning if the prefix of frame names ends with a letter or digit; else empty."""
    if not prefix[-1:].isalnum():
        return ""
    return (
        f"frame_prefix '{prefix}' does not end with a slash, so the frame odom is named"
        f" {prefix}odom; if you do not want this, set frame_prefix to {prefix}/"
    )


def unread_files(arguments: Sequence[str], node: str) -> list[str]:
    """Return a warning for each parameter file that has no parameters for this node.

    ``arguments``: the command line. ``node``: the node's full name, such as /robot1/omnibot_driver.
    """
    return [
        f"the --params-file {file} has no parameters for this node, {node}; begin the file with"
        " /**:"
        for option, file in pairwise(arguments)
        if option == "--params-file" and not _is_for(node, file)
    ]


def _is_for(node: str, file: str) -> bool:
    if not Path(file).is_file():
        return True  # a pipe, which ROS has emptied: its content is unknown
    try:
        content = yaml.safe_load(Path(file).read_text(encoding="utf-8"))
    except (OSError, ValueError, yaml.YAMLError):
        return True  # ROS could read this file, so do not warn
    return any(re.fullmatch(pattern, node) for pattern in _sections(content))


def _sections(content: Any, above: str = "") -> Iterator[str]:
    """Yield, for each section of a parameter file, a pattern of the full names of its nodes.

    In the file, ``*`` is one part of a name, ``**`` any number of parts.
    """
    for name, below in content.items() if isinstance(content, dict) else ():
        if name == "ros__parameters":
            yield above.replace("/**", r"(/\w+)*").replace("/*", r"/\w+")
        else:
            part = str(name).strip("/")  # empty for the root namespace
            yield from _sections(below, f"{above}/{part}" if part else above)


def namesake_advice(name: str, publishers: Iterable[Any]) -> str:
    """Return a warning if another node has this full name; otherwise empty.

    ``publishers``: the publishers of a topic that every driver with this name publishes, such as
    ``~/state``.
    """
    names = [f"{each.node_namespace.rstrip('/')}/{each.node_name}" for each in publishers]
    if names.count(name) < 2:
        return ""
    return (
        f"another node has the name {name}, and both obey the same commands; end one node, or"
        " start one node in its own namespace (--ros-args -r __ns:=/robot2)"
    )


def type_conflict(publishers: Iterable[Any], *, stamped: bool) -> str:
    """Return a warning if ``cmd_vel`` is published with a type that the driver does not receive."""
    ours, other = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
    if stamped:
        ours, other = other, ours
    unheard = sorted(
        {publisher.node_name for publisher in publishers if publisher.topic_type != ours}
    )
    if not unheard:
        return ""
    return (
        f"{', '.join(unheard)} publishes cmd_vel with a type other than {ours}, so the driver"
        f" does not receive it; to receive {other}, start the driver with"
        f" enable_stamped_cmd_vel:={str(not stamped).lower()}"
    )
