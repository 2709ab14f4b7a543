# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Publishers of ``cmd_vel`` for the benchmark's processes that command robots."""

import time
from collections.abc import Sequence
from typing import Any

import rclpy
from geometry_msgs.msg import Twist
from rclpy.node import Node


def connected(namespaces: Sequence[str]) -> list[Any]:
    """Initialize ROS, and return one publisher per namespace.

    Before it returns, the function waits until each publisher has a subscriber. Then it waits for
    one more second.
    """
    rclpy.init()
    node = Node("hand", start_parameter_services=False, enable_rosout=False)
    publishers = [node.create_publisher(Twist, f"{name}/cmd_vel", 1) for name in namespaces]
    while any(publisher.get_subscription_count() == 0 for publisher in publishers):
        time.sleep(0.01)  # without an executor a new subscriber raises no event
    time.sleep(1.0)  # the subscribers must find the publishers, too
    return publishers
