# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Diagnostics: a report on the link, the board and the commands, once a second on ``/diagnostics``.

If the package diagnostic_updater is missing, this module publishes the same message itself. The
timer must use the steady clock, not simulated time.
"""

import time
from collections.abc import Callable, Sequence
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from omnibot_driver import messages
from omnibot_driver.core.reporting.diagnosis import Diagnosis
from omnibot_driver.core.reporting.figures import Refusals
from omnibot_driver.core.reporting.status import Status
from omnibot_driver.link import Link

PERIOD_S: Final = 1.0
Publish = Callable[[Sequence[Status]], None]


class Diagnostics:
    """The publisher of the diagnostics of one link.

    * ``hardware_id``: text that distinguishes this robot from others.
    * ``to_check``: what the user must check if the driver cannot decode the board's data.
    """

    def __init__(
        self,
        node: Node,
        link: Link,
        refusals: Callable[[], Refusals],
        *,
        hardware_id: str,
        to_check: str,
    ) -> None:
        self._link, self._refusals = link, refusals
        self._diagnosis = Diagnosis(to_check)
        self._publish, period_s = _through_updater(node, hardware_id) or (
            _alone(node, hardware_id),
            PERIOD_S,
        )
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(period_s, self._report, clock=steady)

    def _report(self) -> None:
        link, session = self._link.figures()
        self._publish(self._diagnosis.judge(link, session, self._refusals(), time.monotonic()))


def _alone(node: Node, hardware_id: str) -> Publish:
    publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)

    def publish(statuses: Sequence[Status]) -> None:
        stamp = node.get_clock().now().to_msg()
        publisher.publish(
            messages.diagnostic_message(statuses, stamp, node.get_name(), hardware_id)
        )

    return publish


def _through_updater(node: Node, hardware_id: str) -> tuple[Publish, float] | None:
    """Return a function that publishes with diagnostic_updater, and the period of its calls in s.

    Return None if diagnostic_updater is not installed.
    """
    try:
        from diagnostic_updater import Updater
    except ImportError:
        return None
    updater = Updater(node, PERIOD_S)
    updater.timer.cancel()  # this timer runs on ROS time
    updater.setHardwareID(hardware_id)
    judged: dict[str, Status] = {}

    def publish(statuses: Sequence[Status]) -> None:
        new = [status.name for status in statuses if status.name not in judged]
        judged.update({status.name: status for status in statuses})
        for name in new:
            updater.add(name, lambda wrapper, name=name: _fill(wrapper, judged[name]))
        updater.force_update()

    return publish, updater.period


def _fill(wrapper: Any, status: Status) -> Any:
    wrapper.summary(bytes([status.level]), status.message)
    for key, value in status.values.items():
        wrapper.add(key, value)
    return wrapper
