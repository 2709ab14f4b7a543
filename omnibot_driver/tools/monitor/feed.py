# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Connects the monitor to the driver: stores received messages in a model, and sends requests.

A separate thread receives messages, so the screen does not delay them.
"""

import os
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Final

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy._rclpy_pybind11 import RCLError, UnknownROSArgsError
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.exceptions import InvalidNamespaceException, InvalidTopicNameException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import Imu
from std_msgs.msg import Bool, String
from std_srvs.srv import SetBool, Trigger

from omnibot_driver.core.geometry.quaternion import yaw_of
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.reporting.status import Status
from omnibot_driver.messages import UNMEASURED_VARIANCE
from omnibot_driver.tools.drivers import running_drivers
from omnibot_driver.tools.monitor.model import (
    DIAGNOSTICS_TOPIC,
    IMU_TOPIC,
    ODOM_TOPIC,
    Model,
    View,
    level,
)
from omnibot_driver.tools.monitor.teleop import DeadMan
from omnibot_driver.tools.monitor.velocity import ANY, VelocityTopic, body_twist
from omnibot_driver.tools.needs import ToolError

LATCHED: Final = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
INSIST_EVERY_S: Final = 0.2
PARAMETERS: Final = ("port", "max_linear_speed", "max_angular_speed")
IMU_PARAMETER: Final = "imu_frame"
"""Name of a parameter that the driver has only if its board has an IMU."""


class Feed:
    """The connection to the driver ``name`` in ``namespace``, until ``close`` is called.

    ``dead_man``: source of the published motion commands; None if the monitor must not move the
    robot. Any thread may send requests. Raises ToolError for invalid names.
    """

    def __init__(
        self, arguments: Sequence[str], namespace: str, name: str, dead_man: DeadMan | None = None
    ) -> None:
        self.dead_man = dead_man
        self._name = name
        self._context = Context()
        try:
            rclpy.init(
                args=list(arguments),
                context=self._context,
                signal_handler_options=SignalHandlerOptions.NO,
            )
            self._node = Node(
                f"monitor_{os.getpid()}",
                namespace=namespace.rstrip("/"),
                context=self._context,
                enable_rosout=False,
                start_parameter_services=False,
            )
            self.driver = self._node.resolve_topic_name(f"{name}/state").removesuffix("/state")
            self._model, self._lock = Model(self.driver, time.monotonic()), threading.Lock()
            self._port, self._without_imu, self._learned = "", False, False
            self._listen()
            self._offer()
        except (InvalidNamespaceException, InvalidTopicNameException) as error:
            raise ToolError(f"not a valid driver name: {error}") from error
        except (RCLError, UnknownROSArgsError) as error:
            raise ToolError(f"ROS does not start: {error}") from error
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._ending = threading.Event()
        self._spinner = threading.Thread(target=self._spin, name="monitor-executor", daemon=True)
        self._spinner.start()

    def close(self) -> None:
        """End the connection. If this monitor has moved the robot, stop the robot first."""
        if self.dead_man:
            self.dead_man.stop()
        self._ending.set()
        self._executor.create_task(lambda: None)
        self._spinner.join(timeout=1.0)
        self._velocity.close()
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def view(self) -> View:
        """Return the values to show now."""
        with self._lock:
            return self._model.view(
                time.monotonic(),
                releasable=self._estop.service_is_ready(),
                steers=self._velocity.steers,
                lacks=self._lacks(),
            )

    def drivers(self) -> list[str]:
        """Return the names of all running drivers, in any namespace."""
        return running_drivers(self._node)

    def namesakes(self) -> str:
        """Return a warning if several drivers have this driver's name, otherwise an empty text."""
        count = self._node.count_publishers(f"{self.driver}/state")
        if count < 2:
            return ""
        return (
            f"there are {count} drivers called {self.driver}: the display mixes their data, and"
            " all of them obey this monitor; end all but one, or give them namespaces"
        )

    def diagnoses(self) -> bool:
        """Return whether the driver publishes diagnostics.

        A driver that replays a recording does not.
        """
        return any(
            f"{info.node_namespace.rstrip('/')}/{info.node_name}" == self.driver
            for info in self._node.get_publishers_info_by_topic(DIAGNOSTICS_TOPIC)
        )

    # Actions of the user

    def estop(self) -> None:
        """Latch the e-stop by a message on the topic and by a call of the service.

        Repeat both until the driver confirms that the e-stop is latched.
        """
        if self.dead_man:
            self.dead_man.stop()
        self._model.estop_asked = True
        self._insist()

    def release(self) -> None:
        """Release the e-stop."""
        self._model.estop_asked = False
        self._call(self._estop, SetBool.Request(data=False), "release")

    def start(self) -> None:
        """Start the board."""
        self._call(self._start, Trigger.Request(), "start")

    def pause(self) -> None:
        """Pause the board."""
        if self.dead_man:
            self.dead_man.stop()
        self._call(self._pause, SetBool.Request(data=True), "pause")

    def reset_odometry(self) -> None:
        """Set the odometry to zero."""
        self._call(self._reset_odometry, Trigger.Request(), "zero odometry")

    # From ROS

    def _listen(self) -> None:
        node, name = self._node, self._name
        node.create_subscription(String, f"{name}/state", self._on_state, LATCHED)
        node.create_subscription(Bool, f"{name}/estop_active", self._on_estop, LATCHED)
        node.create_subscription(Imu, IMU_TOPIC, self._on_imu, ANY)
        node.create_subscription(Odometry, ODOM_TOPIC, self._on_odom, ANY)
        node.create_subscription(DiagnosticArray, DIAGNOSTICS_TOPIC, self._on_diagnostics, ANY)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(INSIST_EVERY_S, self._insist, clock=steady)
        node.create_timer(INSIST_EVERY_S, self._learn, clock=steady)
        self._velocity = VelocityTopic(
            node,
            name,
            self.dead_man,
            lambda twist: self._know(lambda model, now_s: model.commanded(twist, now_s)),
        )

    def _on_state(self, message: String) -> None:
        self._know(lambda model, now_s: model.state(message.data, now_s))
        self._learned = False

    def _learn(self) -> None:
        """Read the driver's parameters, again after each change of the driver's state.

        After such a change, another driver may run under the same name.
        """
        if self._learned or not (self._list.service_is_ready() and self._ask.service_is_ready()):
            return
        self._learned = True
        self._list.call_async(ListParameters.Request()).add_done_callback(self._on_names)
        request = GetParameters.Request(names=PARAMETERS)
        self._ask.call_async(request).add_done_callback(self._on_parameters)

    def _on_names(self, future: Any) -> None:
        self._without_imu = IMU_PARAMETER not in future.result().result.names

    def _lacks(self) -> frozenset[str]:
        """Return those of ``imu``, ``start`` and ``pause`` that the board is known not to have."""
        offers = {"start": self._start, "pause": self._pause}
        if not self._estop.service_is_ready():
            offers = {}
        lacking = {name for name, client in offers.items() if not client.service_is_ready()}
        return frozenset(lacking | ({"imu"} if self._without_imu else set()))

    def _on_parameters(self, future: Any) -> None:
        values = future.result().values
        if len(values) == len(PARAMETERS):
            self._port = values[0].string_value
            if self.dead_man:
                self.dead_man.fastest = (values[1].double_value, values[2].double_value)

    def _on_estop(self, message: Bool) -> None:
        self._know(lambda model, now_s: model.estop(message.data, now_s))
        if message.data:
            self._model.estop_asked = False

    def _on_imu(self, message: Imu) -> None:
        force, rate = message.linear_acceleration, message.angular_velocity
        vectors = (force.x, force.y, force.z), (rate.x, rate.y, rate.z)
        self._know(lambda model, now_s: model.imu(*vectors, now_s))

    def _on_odom(self, message: Odometry) -> None:
        at, turn = message.pose.pose.position, message.pose.pose.orientation
        pose = Pose(at.x, at.y, yaw_of(turn.x, turn.y, turn.z, turn.w))
        twist = body_twist(message.twist.twist)
        known = message.twist.covariance[0] < UNMEASURED_VARIANCE
        self._know(lambda model, now_s: model.odom(pose, twist if known else None, now_s))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        prefix = f"{self.driver.rpartition('/')[2]}: "
        statuses = tuple(
            Status(
                status.name.removeprefix(prefix),
                level(status.level[0]),
                status.message,
                {pair.key: pair.value for pair in status.values},
            )
            for status in message.status
            if status.name.startswith(prefix) and self._port in ("", status.hardware_id)
        )
        if statuses:
            self._know(lambda model, now_s: model.diagnosed(statuses, now_s))

    # To ROS

    def _offer(self) -> None:
        node, name = self._node, self._name
        self._ask = node.create_client(GetParameters, f"{name}/get_parameters")
        self._list = node.create_client(ListParameters, f"{name}/list_parameters")
        self._estop = node.create_client(SetBool, f"{name}/estop")
        self._start = node.create_client(Trigger, f"{name}/start")
        self._pause = node.create_client(SetBool, f"{name}/pause")
        self._reset_odometry = node.create_client(Trigger, f"{name}/reset_odometry")
        self._estop_topic = node.create_publisher(Bool, "estop", 10)

    def _insist(self) -> None:
        if not self._model.estop_asked:
            return
        try:
            self._estop_topic.publish(Bool(data=True))
        finally:
            self._call(self._estop, SetBool.Request(data=True), "e-stop")

    def _call(self, client: Any, request: Any, what: str) -> None:
        if not client.service_is_ready():
            service = self._node.resolve_service_name(client.srv_name)
            self.say(f"{what}: service {service} not found; try again if the driver is running")
            return
        self.say(f"{what}: requested, no answer yet")
        client.call_async(request).add_done_callback(partial(self._answered, what))

    def _answered(self, what: str, future: Any) -> None:
        answer = future.result()
        self.say(f"{what}: {'' if answer.success else 'failed: '}{answer.message}")
        if answer.success and what == "e-stop":
            self._model.estop_asked = False

    def say(self, text: str) -> None:
        """Show a text in the screen's line for replies to the user."""
        with self._lock:
            self._model.said = text

    def _know(self, tell: Callable[[Model, float], None]) -> None:
        with self._lock:
            tell(self._model, time.monotonic())

    def _spin(self) -> None:
        try:
            while not self._ending.is_set():
                self._executor.spin_once()
        except ExternalShutdownException:
            pass
        except Exception as error:
            self.say(
                f"because of a bug, this monitor receives nothing any more: {error!r}; start it"
                " again, and please report the bug"
            )
            raise
