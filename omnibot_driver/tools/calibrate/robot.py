# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The robot as a calibration uses it: receive its data, and move it.

All motion goes through ``drive`` or ``record``, which end with stop commands. This module does not
know what is calibrated.
"""

import math
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from functools import partial
from pathlib import Path
from typing import Any, Final

from geometry_msgs.msg import Twist, TwistStamped
from rclpy.context import Context
from rclpy.node import Node
from std_msgs.msg import Float32MultiArray
from std_srvs.srv import Trigger

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.readings import Vector3
from omnibot_driver.tools.calibrate.client import ANSWER_WITHIN_S
from omnibot_driver.tools.calibrate.interruption import Interruption
from omnibot_driver.tools.calibrate.listener import ODOMETRY, Listener
from omnibot_driver.tools.calibrate.log import Log
from omnibot_driver.tools.calibrate.motion import HALT, Bounds, Law, Obedience, Topic
from omnibot_driver.tools.needs import ToolError

PERIOD_S: Final = 0.02
"""Period, in s, with which the tool sends commands."""
STANDS_WITHIN_S: Final = 3.0
ASKED_WITHIN_S: Final = 0.6
"""Time, in s, from the request for a record to the start of the motion, so that the driver can
repeat a lost request."""
STOPPING_S: Final = 3.0
STOOD_S: Final = 0.3
"""Time in s for which the robot must be at rest before the tool regards it as stopped."""
STANDING: Final = 0.01
"""Largest speed, in m/s, and largest yaw rate, in rad/s, of a robot at rest."""
UNRULY: Final = (
    "Stop was sent, but the robot still moves, or no odometry arrives; cut its power, then see"
    " docs/safety.md"
)


class Robot(Listener):
    """A robot that a calibration drives through its driver."""

    def __init__(self, node: Node, context: Context, interruption: Interruption) -> None:
        super().__init__(node, context, interruption)
        self._stamped = bool(self.parameters["enable_stamped_cmd_vel"])
        self._unanswered: Counter[tuple[Topic, tuple[float, ...]]] = Counter()
        """For each topic and command: number of messages that this node has published, but has not
        received itself yet. A negative number shows that another node has published this command.
        """
        self._foreign: Topic | None = None
        kinds: dict[Topic, Any] = {
            "cmd_vel": TwistStamped if self._stamped else Twist,
            "wheel_cmd": Float32MultiArray,
        }
        self._publishers = {}
        for topic, kind in kinds.items():
            self._publishers[topic] = node.create_publisher(kind, topic, 1)
            node.create_subscription(kind, topic, partial(self._on_command, topic), 10)

    def rest(
        self,
        seconds: float,
        *,
        show: Callable[[float], object] = lambda _part: None,
        states: Sequence[str] = ("nominal",),
    ) -> Log:
        """Record data for ``seconds`` without commands; return the log.

        ``show``: called with the completed fraction.

        ``states``: allowed states of the driver. Another state raises ToolError.
        """
        self._begin(states)
        began_s = now_s = time.monotonic()
        while now_s < began_s + seconds:
            self._spin(0.1)
            now_s = time.monotonic()
            show((now_s - began_s) / seconds)
            self._require_sound(states)
        return self.log

    def drive(
        self,
        law: Law,
        bounds: Bounds,
        *,
        topic: Topic = "cmd_vel",
        obeys: bool = True,
        monitored: bool = True,
        show: Callable[[float], object] = lambda _seconds: None,
    ) -> Log:
        """Move the robot by ``law`` within ``bounds``, stop it, and return the log.

        * ``obeys``: whether to raise an error if the robot does not move.
        * ``monitored``: whether the driver's motion monitor stays on. It must be off until speed
          and direction are calibrated.
        * ``show``: called with the seconds since the start of the motion.

        Raises ToolError on an e-stop, lost data, another node's command, a motion beyond the
        bounds, no motion, no standstill at the end, or clocks that differ.
        """
        if self.parameters.get("control_method", "velocity") != "velocity":
            raise ToolError(
                "this calibration needs the board's switch on velocity control, and"
                " `control_method: velocity`"
            )
        self._begin(("nominal",))
        self._unanswered = +self._unanswered  # commands of the last drive may still arrive
        self._foreign = None
        stands = True  # until the first command
        try:
            with nullcontext() if monitored else self._unmonitored():
                try:
                    stands = False
                    self._follow(law, bounds, topic, obeys, show)
                finally:
                    stands = self._halt(topic)
            self._require_sound()
        except ToolError as error:
            if stands:
                raise
            raise type(error)(f"{error}; and {UNRULY}") from error
        if not stands:
            raise ToolError(UNRULY)
        self._require_one_clock()
        return self.log

    def record(self, service: str, topic: str, command: Sequence[float]) -> Path:
        """Let the driver record the response to ``command``; return the path of the record's file.

        The robot must be at rest. Other nodes' commands are not noticed. Raises ToolError on an
        e-stop, lost data, or a failure.
        """
        self._begin(("nominal",))
        publisher = self._node.create_publisher(Float32MultiArray, topic, 1)
        client = self._node.create_client(Trigger, f"{self.driver}/{service}")
        try:
            if not self._wait(client.service_is_ready, ANSWER_WITHIN_S):
                raise ToolError(f"{self.driver} does not offer ~/{service}")
            answer, asked_s = client.call_async(Trigger.Request()), time.monotonic()
            with self._unmonitored():
                try:
                    while not answer.done():
                        self._spin(PERIOD_S)
                        self._require_sound()
                        if time.monotonic() - asked_s > ASKED_WITHIN_S:
                            publisher.publish(Float32MultiArray(data=command))
                finally:
                    for _ in range(round(STOPPING_S / PERIOD_S)):
                        publisher.publish(Float32MultiArray(data=[0.0] * len(command)))
                        self._hear(PERIOD_S)
        finally:
            self._node.destroy_publisher(publisher)
            self._node.destroy_client(client)
        done: Any = answer.result()
        if not done.success:
            raise ToolError(f"{service}: {done.message}")
        return Path(done.message)

    @contextmanager
    def _unmonitored(self) -> Iterator[None]:
        """A context in which the driver's motion monitor is off.

        The monitor would stop a robot whose parameters are not calibrated yet.
        """
        before = {"motion_monitor": self.parameters["motion_monitor"]}
        self._interruption.check()
        try:
            # The driver may set the parameter although this call is interrupted.
            self.set_parameters({"motion_monitor": False})
            yield
        except BaseException:  # also after an error in this program
            with suppress(ToolError):
                self.restore_parameters(before)
            raise
        self.restore_parameters(before)

    def _follow(
        self,
        law: Law,
        bounds: Bounds,
        topic: Topic,
        obeys: bool,
        show: Callable[[float], object],
    ) -> None:
        first, obedience = self._pose, Obedience(topic, self.parameters)
        began_s = last_s = time.monotonic()
        command, wanted = HALT, law(0.0, Pose())
        while wanted is not None or command != HALT:
            now_s = time.monotonic()
            self._require_unforgotten(now_s - last_s)
            target = HALT if wanted is None else wanted
            bounds.require_allowed(topic, target)
            command = bounds.approach(topic, command, target, max(PERIOD_S, now_s - last_s))
            measured = self._wheel_rates if topic == "wheel_cmd" else self._twist
            if obeys:
                obedience.look(now_s, now_s - last_s, command, measured)
            self._send(topic, command)
            self._spin(PERIOD_S)
            self._require_sound()
            self._require_sole()
            last_s, now_s = now_s, time.monotonic()
            way = first.way_to(self._pose)
            pose = Pose(way.x_m, way.y_m, self._pose.yaw_rad - first.yaw_rad)
            bounds.require_within(now_s - began_s, pose)
            show(now_s - began_s)
            wanted = law(now_s - began_s, pose) if wanted is not None else None

    def _halt(self, topic: Topic) -> bool:
        """Stop the robot, even after Ctrl-C; return whether it is at rest."""
        began_s = now_s = time.monotonic()
        standing_since_s = math.inf
        while now_s < (
            max(began_s, min(self._heard_s[ODOMETRY], began_s + STANDS_WITHIN_S)) + 2 * STOOD_S
        ):
            self._send(topic, HALT)
            self._hear(PERIOD_S)
            if time.monotonic() - self._heard_s[ODOMETRY] > STOOD_S:
                self._hear_pending()
            now_s = time.monotonic()
            stands = all(abs(speed) <= STANDING for speed in self._twist)  # NaN is not rest
            standing_since_s = min(standing_since_s, now_s) if stands else math.inf
            if now_s - standing_since_s > STOOD_S:
                return True
        return False

    def _send(self, topic: Topic, command: Vector3) -> None:
        now = self._node.get_clock().now()
        if topic == "wheel_cmd":
            message = Float32MultiArray(data=command)
        else:
            message = Twist()
            message.linear.x, message.linear.y, message.angular.z = command
            if self._stamped:
                message = TwistStamped(twist=message)
                message.header.stamp = now.to_msg()
        self._unanswered[topic, _values(message)] += 1
        self.log.command_rows.append((now.nanoseconds * 1e-9, *command))
        self._publishers[topic].publish(message)

    def _on_command(self, topic: Topic, message: Any) -> None:
        said = topic, _values(message)
        self._unanswered[said] -= 1
        if self._unanswered[said] < 0:
            self._foreign = topic

    def _require_sole(self) -> None:
        if self._foreign:
            others = {
                f"{info.node_namespace.rstrip('/')}/{info.node_name}"
                for info in self._node.get_publishers_info_by_topic(
                    self._node.resolve_topic_name(self._foreign)
                )
            } - {self._node.get_fully_qualified_name()}
            raise ToolError(
                f"another node commands the robot on {self._foreign}"
                f" ({', '.join(sorted(others))}): end that node first"
            )

    def _require_unforgotten(self, silence_s: float) -> None:
        """Raise ToolError if no command was sent for longer than the driver's timeout.

        In this case, the driver has stopped the robot. ``silence_s``: time since the last command.
        """
        if silence_s > self.parameters["cmd_vel_timeout"]:
            raise ToolError(
                f"this program did not run for {silence_s:.1f} s, so the driver stopped the"
                " robot: reduce the load of this computer, then begin again"
            )


def _values(message: Any) -> tuple[float, ...]:
    if isinstance(message, Float32MultiArray):
        return tuple(message.data)
    twist = message.twist if isinstance(message, TwistStamped) else message
    return twist.linear.x, twist.linear.y, twist.angular.z
