# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Receives ``cmd_vel`` from any node, and publishes commands while keys are pressed."""

import time
from collections.abc import Callable
from typing import Any, Final

from geometry_msgs.msg import Twist, TwistStamped
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.tools.monitor.teleop import HALT, DeadMan

TOPIC: Final = "cmd_vel"
ANY: Final = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)
"""QoS profile that receives from reliable and from best-effort publishers."""
LOOK_EVERY_S: Final = 0.5
DRIVE_EVERY_S: Final = 0.05
ACKNOWLEDGED_WITHIN_S: Final = 0.5


class VelocityTopic:
    """The monitor's subscription and publisher of ``cmd_vel``, with the driver's message type.

    ``heard``: function that is called with each command on the topic.

    ``dead_man``: converts pressed keys to the published commands; None: no command is published.
    """

    def __init__(
        self,
        node: Node,
        driver: str,
        dead_man: DeadMan | None,
        heard: Callable[[BodyTwist], None],
    ) -> None:
        self.dead_man = dead_man
        self.steers = False
        """Whether this object publishes commands, and another node receives them."""
        self._node, self._driver, self._heard = node, driver, heard
        self._subscription: Any = None
        self._publisher: Any = None
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(LOOK_EVERY_S, self._look, clock=steady)
        if dead_man:
            node.create_timer(DRIVE_EVERY_S, self._tick, clock=steady)

    def close(self) -> None:
        """Stop the robot if this program has steered it.

        The caller must end the spinning of the node before this call.
        """
        if self.dead_man and self.dead_man.has_driven and self._publisher:
            self._say(HALT)
            self._publisher.wait_for_all_acked(Duration(seconds=ACKNOWLEDGED_WITHIN_S))

    def _look(self) -> None:
        self.steers = bool(self._publisher) and self._publisher.get_subscription_count() > 1
        infos = self._node.get_subscriptions_info_by_topic(self._node.resolve_topic_name(TOPIC))
        takers = [info for info in infos if info.node_name != self._node.get_name()]
        if not takers:
            return
        taker = min(takers, key=lambda info: info.node_name != self._driver)
        kind = TwistStamped if taker.topic_type.endswith("/TwistStamped") else Twist
        if self._subscription and self._subscription.msg_type is kind:
            return
        if self._subscription:
            self._node.destroy_subscription(self._subscription)
        if self._publisher:
            self._node.destroy_publisher(self._publisher)
        self._subscription = self._node.create_subscription(kind, TOPIC, self._on_command, ANY)
        if self.dead_man:
            self._publisher = self._node.create_publisher(kind, TOPIC, 1)

    def _on_command(self, message: Any) -> None:
        self._heard(body_twist(message.twist if isinstance(message, TwistStamped) else message))

    def _tick(self) -> None:
        twist = self.dead_man.command(time.monotonic()) if self.dead_man else None
        if twist and self._publisher:
            self._say(twist)

    def _say(self, twist: BodyTwist) -> None:
        message = Twist()
        message.linear.x, message.linear.y = twist.vx_mps, twist.vy_mps
        message.angular.z = twist.yaw_rate_radps
        if self._publisher.msg_type is TwistStamped:
            stamped = TwistStamped(twist=message)
            stamped.header.stamp = self._node.get_clock().now().to_msg()
            self._publisher.publish(stamped)
        else:
            self._publisher.publish(message)


def body_twist(twist: Any) -> BodyTwist:
    """Return the body twist in a message, unchanged, even if it contains NaN."""
    return BodyTwist(twist.linear.x, twist.linear.y, twist.angular.z)
