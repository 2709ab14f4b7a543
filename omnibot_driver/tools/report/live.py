# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Records the messages of a running robot as a log.

The module knows ROS; it does not know how a log is judged.
"""

import time
from collections.abc import Callable
from functools import partial
from importlib import import_module
from typing import Any, Final

import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from omnibot_driver.tools.drivers import discovery_advice
from omnibot_driver.tools.needs import ToolError
from omnibot_driver.tools.report.log import Log
from omnibot_driver.tools.report.recorder import DIAGNOSTICS, EVENTS, Recorder
from omnibot_driver.tools.report.robots import Topics, choose, find

LOOK_ROUND_S: Final = 2.0
"""Time in s for which the program searches for robots.

The search continues after the first robot, because there may be other robots.
"""
DISCOVERY_S: Final = 5.0
DEPTH: Final = 1000
COMMANDS: Final = ("cmd_vel", "wheel_cmd")

Progress = Callable[[int, int], None]
"""A function that receives the elapsed time and the total time of the recording, in whole s."""


def listen(
    seconds: float, namespace: str | None, progress: Progress, asked_to_end: Callable[[], bool]
) -> Log:
    """Record the messages of one robot for ``seconds``, and return them as a log.

    Raises ToolError if no robot is found or no message arrives.
    """
    try:
        rclpy.init(
            args=["--ros-args", "--disable-external-lib-logs"],
            signal_handler_options=SignalHandlerOptions.NO,
        )
    except RCLError as error:
        raise ToolError(f"ROS does not start: {error}") from error
    try:
        node = rclpy.create_node("omnibot_report")
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        robot, topics, kinds = _discover(node, executor, namespace, asked_to_end)
        recorder = Recorder(robot)
        for topic, role in topics.items():
            _subscribe(node, recorder, topic, role, kinds[topic])
        published = [role for topic, role in topics.items() if node.count_publishers(topic)]
        began_s = time.monotonic()
        while (spent_s := time.monotonic() - began_s) < seconds and not asked_to_end():
            progress(int(spent_s), int(seconds))
            executor.spin_once(timeout_sec=0.1)
        progress(int(seconds), int(seconds))
        # Other robots may be discovered late, so they are counted at the end.
        kinds = {topic: types[0] for topic, types in node.get_topic_names_and_types()}
        alone = {*_robots(node, kinds)} <= {robot}
    except ExternalShutdownException as error:
        raise ToolError("ROS was shut down during the recording") from error
    finally:
        rclpy.try_shutdown()
    if not recorder.count:
        raise ToolError(
            f"the driver of {robot} sent nothing for {spent_s:.1f} s: is it still running?"
        )
    return recorder.log(topics=published, alone=alone)


def _discover(
    node: Node,
    executor: SingleThreadedExecutor,
    namespace: str | None,
    asked_to_end: Callable[[], bool],
) -> tuple[str, Topics, dict[str, str]]:
    """Find the robot; return its namespace, its topics, and the types of all topics."""
    began_s = time.monotonic()
    while True:
        executor.spin_once(timeout_sec=0.1)
        spent_s = time.monotonic() - began_s
        if spent_s < LOOK_ROUND_S and not asked_to_end():
            continue
        kinds = {topic: types[0] for topic, types in node.get_topic_names_and_types()}
        robots = _robots(node, kinds)
        try:
            robot, topics = choose(robots, namespace, "ROS")
        except ToolError as error:
            if robots and namespace is None:
                raise
            if spent_s < DISCOVERY_S and not asked_to_end():
                continue
            if robots:
                raise
            raise ToolError(
                f"no driver was found within {spent_s:.0f} s: check that a driver runs with the"
                " same ROS_DOMAIN_ID and ROS_AUTOMATIC_DISCOVERY_RANGE as this"
                f" program{discovery_advice()}"
            ) from error
        return robot, topics, kinds


def _robots(node: Node, kinds: dict[str, str]) -> dict[str, Topics]:
    """Return the topics of each robot whose driver runs. ``kinds``: the types of all topics."""
    return {
        name: topics
        for name, topics in find(kinds.items()).items()
        if any(node.count_publishers(topic) for topic, role in topics.items() if role == "state")
    }


def _subscribe(node: Node, recorder: Recorder, topic: str, role: str, kind: str) -> None:
    package, _, name = kind.split("/")
    latched = role in EVENTS and role != DIAGNOSTICS
    qos = QoSProfile(
        depth=DEPTH,
        # The node that sends commands may be a best-effort publisher. A best-effort subscription
        # receives from best-effort and from reliable publishers.
        reliability=ReliabilityPolicy.BEST_EFFORT
        if role in COMMANDS
        else ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )
    hear = partial(_hear, recorder, role, kind)

    # rclpy passes a message's info only to a callback that has two parameters.
    def heard(message: Any, info: Any) -> None:
        hear(message, info)

    message_class = getattr(import_module(f"{package}.msg"), name)
    node.create_subscription(message_class, topic, heard, qos)


def _hear(recorder: Recorder, role: str, kind: str, message: Any, info: Any) -> None:
    recorder.hear(role, kind, info["received_timestamp"], message)
