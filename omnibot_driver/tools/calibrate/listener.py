# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The client that receives a robot's data for a calibration, and checks them.

This module knows data; it does not know commands.
"""

import math
import time
from collections.abc import Mapping, Sequence
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Bool, String

from omnibot_driver.core.geometry.quaternion import yaw_of
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.tools.calibrate.client import FOUND_WITHIN_S, Client
from omnibot_driver.tools.calibrate.interruption import Interruption
from omnibot_driver.tools.calibrate.log import Log
from omnibot_driver.tools.calibrate.motion import HALT
from omnibot_driver.tools.needs import ToolError

IMU, ODOMETRY = TOPICS = "imu/data_raw", "odom"
LOST_S: Final = 0.3
"""Time without data, in s, after which the tool stops a motion."""
CLOCKS_S: Final = 0.1
"""Largest accepted difference between the driver's clock and this computer's clock, in s. Commands
have times of this computer, odometry has times of the driver."""
AT_ONCE: Final = 100
"""Largest number of pending messages that are read at once."""
LATCHED: Final = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Listener(Client):
    """A client that records the robot's data in ``log``.

    ``log`` begins anew with each motion, and with each recording during which the robot gets no
    commands.
    """

    def __init__(self, node: Node, context: Context, interruption: Interruption) -> None:
        super().__init__(node, context, interruption)
        self.log = Log()
        self._states: list[str] = []
        self._estop = False
        has_imu = "imu_frame" in self.parameters
        self._topics: Sequence[str] = TOPICS if has_imu else (ODOMETRY,)
        self._heard_s = dict.fromkeys(self._topics, -math.inf)
        self._delay_s = math.inf
        """Shortest delay of an odometry message in this motion, from timestamp to arrival, in s."""
        self._pose, self._twist = Pose(), HALT
        self._wheel_rates: tuple[float, ...] = HALT
        if has_imu:
            node.create_subscription(Imu, IMU, self._on_imu, 50)
        node.create_subscription(Odometry, ODOMETRY, self._on_odometry, 50)
        node.create_subscription(JointState, "joint_states", self._on_wheels, 50)
        node.create_subscription(String, f"{self.driver}/state", self._on_state, LATCHED)
        node.create_subscription(Bool, f"{self.driver}/estop_active", self._on_estop, LATCHED)
        first = self._topics[0]
        if not self._wait(lambda: self._states and self._heard_s[first] > 0, FOUND_WITHIN_S):
            state = self._states[-1] if self._states else "unknown"
            raise ToolError(
                f"{self.driver} publishes nothing on {first} (state: {state}): see the driver's"
                " log, and docs/troubleshooting.md"
            )

    def diagnosed(self, key: str) -> str:
        """Return the value of ``key`` in the driver's next diagnostics.

        The result is empty if the driver does not report this key in time.
        """
        values: dict[str, str] = {}

        def hear(message: DiagnosticArray) -> None:
            for status in message.status:
                if status.hardware_id == self.parameters["port"]:
                    values.update((each.key, each.value) for each in status.values)

        subscription = self._node.create_subscription(DiagnosticArray, "/diagnostics", hear, 10)
        try:
            self._wait(lambda: key in values, FOUND_WITHIN_S)
        finally:
            self._node.destroy_subscription(subscription)
        return values.get(key, "")

    def _on_imu(self, message: Imu) -> None:
        self._heard_s[IMU] = time.monotonic()
        force, rate = message.linear_acceleration, message.angular_velocity
        self.log.imu_rows.append(
            (_seconds(message), force.x, force.y, force.z, rate.x, rate.y, rate.z)
        )

    def _on_odometry(self, message: Odometry, info: Mapping[str, int]) -> None:
        self._heard_s[ODOMETRY] = time.monotonic()
        received_ns = info["received_timestamp"] or self._node.get_clock().now().nanoseconds
        self._delay_s = min(self._delay_s, received_ns * 1e-9 - _seconds(message))
        position, turn = message.pose.pose.position, message.pose.pose.orientation
        twist = message.twist.twist
        yaw_rad = yaw_of(turn.x, turn.y, turn.z, turn.w)
        yaw_rad = self._pose.yaw_rad + math.remainder(yaw_rad - self._pose.yaw_rad, math.tau)
        self._pose = Pose(position.x, position.y, yaw_rad)
        self._twist = (twist.linear.x, twist.linear.y, twist.angular.z)
        self.log.odometry_rows.append(
            (_seconds(message), position.x, position.y, yaw_rad, *self._twist)
        )

    def _on_wheels(self, message: JointState) -> None:
        known = len(message.velocity) == len(message.name)
        rates = tuple(message.velocity) if known else (math.nan,) * len(message.name)
        if known:
            self._wheel_rates = rates
        self.log.wheel_rows.append((_seconds(message), *message.position, *rates))

    def _on_state(self, message: String) -> None:
        self._states.append(message.data)

    def _on_estop(self, message: Bool) -> None:
        self._estop = message.data

    def _begin(self, states: Sequence[str]) -> None:
        """Wait for fresh data, then begin a new log.

        Data from before this call may be old, because the tool receives nothing while it waits for
        the user.
        """
        self._require_alone()
        self._heard_s = dict.fromkeys(self._topics, -math.inf)
        self._wait(lambda: min(self._heard_s.values()) > 0, 1.0)
        del self._states[:-1]
        self._require_sound(states)
        self.log, self._delay_s = Log(), math.inf

    def _require_sound(self, states: Sequence[str] = ("nominal",)) -> None:
        if self._estop:
            raise ToolError("the e-stop is latched: release it with ~/estop, then begin again")
        for state in self._states:
            if state not in states:
                raise ToolError(
                    f"the driver reported the state {state}, but {' or '.join(states)} is needed:"
                    " see the driver's log; if the board is paused, start it with ~/start"
                )
        if lost := self._lost():
            raise ToolError(
                f"no messages on {' and '.join(lost)} for {LOST_S:g} s: check that the driver"
                " still runs, and that computer and network are not overloaded"
            )

    def _require_one_clock(self) -> None:
        """Raise ToolError if the driver's clock and this computer's differed in this motion."""
        if math.isfinite(self._delay_s) and abs(self._delay_s) > CLOCKS_S:
            raise ToolError(
                f"the fastest odometry message arrives {self._delay_s:.2f} s after its timestamp."
                " So the clocks of this computer and of the robot differ, and the commands cannot"
                " be compared with the motion. Synchronise the clocks (chrony), or run this tool on"
                " the robot's computer"
            )

    def _lost(self) -> list[str]:
        """Return the required topics without recent data.

        If a topic seems silent, the pending messages are read first.
        """
        wanted = (IMU,) if self._states[-1] == "imu_only" else self._topics
        if silent(self._heard_s, wanted, time.monotonic()):
            self._hear_pending()
        return silent(self._heard_s, wanted, time.monotonic())

    def _hear_pending(self) -> None:
        """Read the messages that have already arrived, but that this program has not read yet."""
        for _ in range(AT_ONCE):
            self._executor.spin_once(timeout_sec=0.0)


def silent(heard_s: Mapping[str, float], wanted: Sequence[str], now_s: float) -> list[str]:
    """Return those of the topics ``wanted`` that had no message for 0.3 s (``LOST_S``).

    ``heard_s``: time of the last message of each topic, in s.
    """
    return [topic for topic in wanted if now_s - heard_s[topic] > LOST_S]


def _seconds(message: Any) -> float:
    stamp = message.header.stamp
    return float(stamp.sec + stamp.nanosec * 1e-9)
