"""``/diagnostics`` once a second: the link's figures, judged, as a message.

The message is published as diagnostic_updater would (topic, period, names, hardware id), with or
without that library: one way is enough, and needs nothing that may be missing. The timer runs on
the steady clock, so simulated time does not stop it.
"""

import time
from collections.abc import Callable
from typing import Final

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from omnibot_driver import messages
from omnibot_driver.core.diagnosis import Diagnosis, Refusals
from omnibot_driver.link import Link

PERIOD_S: Final = 1.0


class Diagnostics:
    """``refusals`` is asked each time; ``hardware_id`` tells robots apart."""

    def __init__(
        self, node: Node, link: Link, refusals: Callable[[], Refusals], hardware_id: str
    ) -> None:
        self._node, self._link, self._refusals = node, link, refusals
        self._hardware_id = hardware_id
        self._diagnosis = Diagnosis()
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(PERIOD_S, self._publish, clock=steady)

    def _publish(self) -> None:
        link, session = self._link.figures()
        statuses = self._diagnosis.judge(link, session, self._refusals(), time.monotonic())
        stamp = self._node.get_clock().now().to_msg()
        name = self._node.get_name()
        self._publisher.publish(
            messages.diagnostic_message(statuses, stamp, name, self._hardware_id)
        )
