# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The publisher of ``/tf``. It needs tf2_ros, and logs a warning if tf2_ros is missing."""

from collections.abc import Callable
from typing import Any, Final

from geometry_msgs.msg import TransformStamped
from rclpy.node import Node

MISSING: Final = (
    "tf2_ros is not installed, so the transform from odom to the base is not published: install"
    " ros-jazzy-tf2-ros, or set publish_tf to false"
)


def transform_publisher(node: Node) -> Callable[[TransformStamped], Any] | None:
    """Return a function that publishes a transform.

    If tf2_ros is not installed, log a warning and return None.
    """
    try:
        from tf2_ros import TransformBroadcaster
    except ImportError as error:
        node.get_logger().warning(f"{MISSING} ({error})")
        return None
    send: Callable[[TransformStamped], Any] = TransformBroadcaster(node).sendTransform
    return send
