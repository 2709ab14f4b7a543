# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The robot as a calibration has it: a client of the running driver. Must not know what is found.

Every motion is `drive`, whatever happens ends in commands to stand still; and if this process dies,
the driver's watchdog stops the robot.
"""

import math
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Final

import rclpy
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy._rclpy_pybind11 import RCLError, UnknownROSArgsError
from rclpy.context import Context
from rclpy.exceptions import InvalidNamespaceException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Bool, Float32MultiArray, String

from omnibot_driver.core.board import Vector3
from omnibot_driver.core.se2 import Pose
from omnibot_driver.tools.calibrate.client import FOUND_WITHIN_S, Client
from omnibot_driver.tools.calibrate.interruption import Interruption
from omnibot_driver.tools.calibrate.log import Log
from omnibot_driver.tools.calibrate.motion import HALT, Bounds, Law, Obedience, Topic
from omnibot_driver.tools.needs import ToolError

PERIOD_S: Final = 0.02
"""Between commands."""
LOST_S: Final = 0.3
"""A robot that is not heard for so long is driven no further."""
STANDS_WITHIN_S: Final = 3.0
STOOD_S: Final = 0.3
"""Standing for so long is standing still."""
STANDING: Final = 0.01
"""m/s and rad/s: slower is standing."""
LATCHED: Final = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@contextmanager
def connect(
    namespace: str, ros_arguments: Sequence[str], interruption: Interruption
) -> Iterator["Robot"]:
    """The driver in this namespace. Raises ToolError where there is none."""
    context = Context()
    quiet = SignalHandlerOptions.NO
    try:
        rclpy.init(args=list(ros_arguments), context=context, signal_handler_options=quiet)
    except (RCLError, UnknownROSArgsError) as error:
        raise ToolError(f"ROS does not understand its arguments: {error}") from error
    try:
        try:
            node = Node("calibrate", namespace=namespace, context=context)
        except InvalidNamespaceException as error:
            raise ToolError(f"'{namespace}' is no namespace: {error}") from error
        try:
            yield Robot(node, context, interruption)
        finally:
            node.destroy_node()
    finally:
        rclpy.shutdown(context=context)


class Robot(Client):
    """``log`` is of the motion or rest that is under way, or was last."""

    def __init__(self, node: Node, context: Context, interruption: Interruption) -> None:
        super().__init__(node, context, interruption)
        self.log = Log()
        self._states: list[str] = []
        self._estop = False
        self._imu_at = self._odometry_at = -math.inf
        self._pose, self._twist = Pose(), HALT
        self._wheel_rates = HALT
        self._sent: Counter[Vector3] = Counter()
        self._foreign = False
        self._listen()
        if not self._wait(lambda: self._states and self._imu_at > 0, FOUND_WITHIN_S):
            state = self._states[-1] if self._states else "unknown"
            raise ToolError(
                f"{self.driver} sends no imu/data_raw (state: {state}): see what it logs, and"
                " docs/troubleshooting.md"
            )

    # Hearing

    def _listen(self) -> None:
        node = self._node
        node.create_subscription(Imu, "imu/data_raw", self._on_imu, 50)
        node.create_subscription(Odometry, "odom", self._on_odometry, 50)
        node.create_subscription(JointState, "joint_states", self._on_wheels, 50)
        node.create_subscription(String, f"{self.driver}/state", self._on_state, LATCHED)
        node.create_subscription(Bool, f"{self.driver}/estop_active", self._on_estop, LATCHED)
        self._stamped = bool(self.parameters["enable_stamped_cmd_vel"])
        kind = TwistStamped if self._stamped else Twist
        self._publishers = {
            "cmd_vel": node.create_publisher(kind, "cmd_vel", 1),
            "wheel_cmd": node.create_publisher(Float32MultiArray, "wheel_cmd", 1),
        }
        node.create_subscription(kind, "cmd_vel", self._on_cmd_vel, 10)

    def _on_imu(self, message: Imu) -> None:
        self._imu_at = time.monotonic()
        force, rate = message.linear_acceleration, message.angular_velocity
        self.log.imu_rows.append(
            (_seconds(message), force.x, force.y, force.z, rate.x, rate.y, rate.z)
        )

    def _on_odometry(self, message: Odometry) -> None:
        self._odometry_at = time.monotonic()
        position, turn = message.pose.pose.position, message.pose.pose.orientation
        twist = message.twist.twist
        yaw_rad = 2 * math.atan2(turn.z, turn.w)
        yaw_rad = self._pose.yaw_rad + math.remainder(yaw_rad - self._pose.yaw_rad, math.tau)
        self._pose = Pose(position.x, position.y, yaw_rad)
        self._twist = (twist.linear.x, twist.linear.y, twist.angular.z)
        self.log.odometry_rows.append(
            (_seconds(message), position.x, position.y, yaw_rad, *self._twist)
        )

    def _on_wheels(self, message: JointState) -> None:
        rates = tuple(message.velocity) if len(message.velocity) == 3 else (math.nan,) * 3
        if not math.isnan(rates[0]):
            self._wheel_rates = rates
        self.log.wheel_rows.append((_seconds(message), *message.position, *rates))

    def _on_state(self, message: String) -> None:
        self._states.append(message.data)

    def _on_estop(self, message: Bool) -> None:
        self._estop = message.data

    def _on_cmd_vel(self, message: Any) -> None:
        twist = message.twist if self._stamped else message
        command = (twist.linear.x, twist.linear.y, twist.angular.z)
        self._sent[command] -= 1
        self._foreign = self._foreign or self._sent[command] < 0

    # Watching

    def _unheard(self, at: str) -> bool:
        """Not for too long; what waits to be read is read first, for we may have been slow."""
        if time.monotonic() - getattr(self, at) > LOST_S:
            for _ in range(100):
                self._executor.spin_once(timeout_sec=0.0)
        return time.monotonic() - float(getattr(self, at)) > LOST_S

    def _require_sound(self, states: Sequence[str] = ("nominal",)) -> None:
        if self._estop:
            raise ToolError("the e-stop is latched: release it with ~/estop, then begin again")
        for state in self._states:
            if state not in states:
                raise ToolError(
                    f"the driver's state is or was {state}, not {' or '.join(states)}: see what it"
                    " logs; ~/start starts a paused board"
                )
        lost = [
            topic
            for topic, at in (("imu/data_raw", "_imu_at"), ("odom", "_odometry_at"))
            if self._unheard(at) and not (topic == "odom" and self._states[-1] == "imu_only")
        ]
        if lost:
            raise ToolError(
                f"nothing came on {' and '.join(lost)} for {LOST_S:g} s: is the driver still there,"
                " the computer too busy, the network too slow?"
            )

    def _begin(self, states: Sequence[str]) -> None:
        """Hear the robot anew: while a person was asked, nothing was heard."""
        self._imu_at = self._odometry_at = -math.inf
        self._wait(lambda: self._imu_at > 0 and self._odometry_at > 0, 1.0)
        del self._states[:-1]
        self._require_sound(states)
        self.log = Log()

    # Resting and moving

    def rest(
        self,
        seconds: float,
        *,
        show: Callable[[float], object] = lambda _part: None,
        states: Sequence[str] = ("nominal",),
    ) -> Log:
        """Hear the robot for so long and command nothing. ``show`` is told the part done."""
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
        show: Callable[[float], object] = lambda _seconds: None,
    ) -> Log:
        """Move as the law says, within the bounds, then stand still; what was heard meanwhile.

        ``show`` is told the seconds. Raises ToolError, with the robot told to stand still, on
        whatever is not as it should be: e-stop, lost data, another commander, no motion. Without
        ``obeys`` the last of these is what is to be found out.
        """
        if self.parameters["control_method"] != "velocity":
            raise ToolError(
                "this needs the board's switch on velocity control and `control_method: velocity`"
            )
        self._begin(("nominal",))
        self._sent.clear()
        self._foreign = False
        try:
            self._follow(law, bounds, topic, obeys, show)
        finally:
            stands = self._halt(topic)
        self._require_sound()
        if not stands:
            raise ToolError(
                "the robot was told to stand still and moves: cut its power, then see"
                " docs/safety.md"
            )
        return self.log

    def _follow(
        self,
        law: Law,
        bounds: Bounds,
        topic: Topic,
        obeys: bool,
        show: Callable[[float], object],
    ) -> None:
        first, obedience = self._pose, Obedience(topic)
        began_s = last_s = time.monotonic()
        command, wanted = HALT, law(0.0, Pose())
        while wanted is not None or command != HALT:
            now_s = time.monotonic()
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
        """Whether the robot stands. Not interrupted by anything; short where it is not heard."""
        began_s = now_s = time.monotonic()
        standing_since_s = math.inf
        while now_s < max(began_s, min(self._odometry_at, began_s + STANDS_WITHIN_S)) + 2 * STOOD_S:
            self._send(topic, HALT)
            self._hear(PERIOD_S)
            now_s = time.monotonic()
            moves = max(map(abs, self._twist)) > STANDING
            standing_since_s = math.inf if moves else min(standing_since_s, now_s)
            if now_s - standing_since_s > STOOD_S:
                return True
        return False

    def _send(self, topic: Topic, command: Vector3) -> None:
        if topic == "wheel_cmd":
            message = Float32MultiArray(data=command)
        else:
            twist = Twist()
            twist.linear.x, twist.linear.y, twist.angular.z = command
            message = twist
            if self._stamped:
                message = TwistStamped(twist=twist)
                message.header.stamp = self._node.get_clock().now().to_msg()
            self._sent[command] += 1
        sent_s = self._node.get_clock().now().nanoseconds * 1e-9
        self.log.command_rows.append((sent_s, *command))
        self._publishers[topic].publish(message)

    def _require_sole(self) -> None:
        if self._foreign:
            others = {
                f"{info.node_namespace.rstrip('/')}/{info.node_name}"
                for info in self._node.get_publishers_info_by_topic("cmd_vel")
            } - {self._node.get_fully_qualified_name()}
            raise ToolError(
                f"somebody else commands the robot on cmd_vel ({', '.join(sorted(others))}): end"
                " that first"
            )


def _seconds(message: Any) -> float:
    stamp = message.header.stamp
    return float(stamp.sec + stamp.nanosec * 1e-9)
