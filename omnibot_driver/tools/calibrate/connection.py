# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The connection of a calibration to ROS and to one running driver."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import rclpy
from rclpy._rclpy_pybind11 import RCLError, UnknownROSArgsError
from rclpy.context import Context
from rclpy.exceptions import InvalidNamespaceException
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from omnibot_driver.tools.calibrate.interruption import Interruption
from omnibot_driver.tools.calibrate.robot import Robot
from omnibot_driver.tools.needs import ToolError


@contextmanager
def connect(
    namespace: str, ros_arguments: Sequence[str], interruption: Interruption
) -> Iterator[Robot]:
    """Connect to the driver in ``namespace``.

    Raises ToolError if ``namespace`` or a ROS argument is invalid, or if no driver runs there.
    """
    context = Context()
    quiet = SignalHandlerOptions.NO
    try:
        rclpy.init(args=list(ros_arguments), context=context, signal_handler_options=quiet)
    except (RCLError, UnknownROSArgsError) as error:
        raise ToolError(f"the ROS arguments (after --ros-args) are invalid: {error}") from error
    try:
        try:
            node = Node("calibrate", namespace=namespace.rstrip("/"), context=context)
        except InvalidNamespaceException as error:
            raise ToolError(f"'{namespace}' is not a valid namespace: {error}") from error
        try:
            yield Robot(node, context, interruption)
        finally:
            node.destroy_node()
    finally:
        rclpy.shutdown(context=context)
