# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The demo's robot: reads the driver's topics, and publishes commands that drive a square.

The module must not know who started the robot, or how the robot is shown.
"""

import math
import time
from collections import deque

import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy._rclpy_pybind11 import RCLError
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import Imu
from std_msgs.msg import Bool, String

from omnibot_driver.core.geometry.quaternion import yaw_of
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.demo.display import status_row
from omnibot_driver.demo.program import DemoFailed
from omnibot_driver.demo.square import HALT, steer, steer_ahead
from omnibot_driver.tools.monitor.rates import Rate

REMEMBERED = 1000
"""Number of points of the path that are kept, enough for several laps."""
ENOUGH_IMU_HZ, ENOUGH_ODOM_HZ = 20, 8
"""Message rates in Hz that must be reached before the robot drives. Every board exceeds these rates
when its driver has run for a while."""


class Robot:
    """A ROS node that observes and steers the demo's robot through the driver's topics.

    ``driving``: whether the commanded velocity drives the square; otherwise it is zero. ``leg``:
    number of completed sides. Raises DemoFailed if ROS does not start.
    """

    def __init__(self, namespace: str, *, imu: bool = True, sideways: bool = True) -> None:
        self._steer = steer if sideways else steer_ahead
        self.driving = False
        self.leg, self.driven_m, self.pose = 0, 0.0, Pose()
        self.points: deque[tuple[float, float]] = deque(maxlen=REMEMBERED)
        self.imu = Rate(time.monotonic()) if imu else None
        self.odom = Rate(time.monotonic())
        self._state, self._estop = "starting", False
        self._commanded = self._measured = HALT
        self._stood_for = 0
        try:
            rclpy.init(
                args=["--ros-args", "--disable-external-lib-logs"],
                signal_handler_options=SignalHandlerOptions.NO,
            )
        except RCLError as error:
            raise DemoFailed(f"ROS does not start: {error}") from error
        self._node = node = rclpy.create_node("demo", namespace=namespace)
        self._cmd_vel = node.create_publisher(Twist, "cmd_vel", 1)
        if imu:
            node.create_subscription(Imu, "imu/data_raw", self._on_imu, 1000, raw=True)
        node.create_subscription(Odometry, "odom", self._on_odom, 50)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        node.create_subscription(String, "omnibot_driver/state", self._on_state, latched)
        node.create_subscription(Bool, "omnibot_driver/estop_active", self._on_estop, latched)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(node)

    def close(self) -> None:
        """End the executor and the connection to ROS.

        An executor that is still active would report errors when the program ends.
        """
        self._executor.shutdown(timeout_sec=0.0)
        rclpy.try_shutdown()

    def spin_once(self) -> None:
        """Handle the next message, or return after 50 ms without one."""
        self._executor.spin_once(timeout_sec=0.05)

    def missing(self) -> list[str]:
        """Return what is still missing before the robot can drive: topics, or the state nominal."""
        now_s = time.monotonic()
        topics = [("imu/data_raw", self.imu, ENOUGH_IMU_HZ), ("odom", self.odom, ENOUGH_ODOM_HZ)]
        missing = [
            f"{name} ({hz:.0f} Hz)"
            for name, rate, enough_hz in topics
            if rate is not None and (hz := rate.hz(now_s)) < enough_hz
        ]
        return missing if self._state == "nominal" else [*missing, f"nominal state ({self._state})"]

    def watched(self) -> bool:
        """Return whether another program, such as the monitor, also receives the odometry."""
        return self._node.count_subscribers("odom") > 1

    def stands(self) -> bool:
        """Return whether the robot is at rest, by its last five odometry messages."""
        return self._stood_for >= 5

    def row(self) -> str:
        """Return a row of text with the current state, rates, pose and velocities."""
        now_s = time.monotonic()
        imu_hz = None if self.imu is None else round(self.imu.hz(now_s))
        rates_hz = (imu_hz, round(self.odom.hz(now_s)))
        state = "e-stop" if self._estop else self._state
        return status_row(state, rates_hz, self.leg, self.pose, self._commanded, self._measured)

    def _on_state(self, message: String) -> None:
        self._state = message.data

    def _on_estop(self, message: Bool) -> None:
        self._estop = message.data

    def _on_imu(self, _message: bytes) -> None:
        if self.imu is not None:
            self.imu.arrived(time.monotonic())

    def _on_odom(self, message: Odometry) -> None:
        self.odom.arrived(time.monotonic())
        position, turn = message.pose.pose.position, message.pose.pose.orientation
        before, self.pose = (
            self.pose,
            Pose(position.x, position.y, yaw_of(turn.x, turn.y, turn.z, turn.w)),
        )
        self.driven_m += math.dist((before.x_m, before.y_m), (self.pose.x_m, self.pose.y_m))
        self.points.append((position.x, position.y))
        linear, angular = message.twist.twist.linear, message.twist.twist.angular
        self._measured = BodyTwist(linear.x, linear.y, angular.z)
        moves = max(abs(linear.x), abs(linear.y), abs(angular.z)) > 0.002
        self._stood_for = 0 if moves or self.driving else self._stood_for + 1
        if self.odom.count % 2:
            self._command()

    def _command(self) -> None:
        self._commanded = HALT
        if self.driving:
            self.leg, self._commanded = self._steer(self.pose, self.leg)
        message = Twist()
        message.linear.x, message.linear.y = self._commanded.vx_mps, self._commanded.vy_mps
        message.angular.z = self._commanded.yaw_rate_radps
        self._cmd_vel.publish(message)
