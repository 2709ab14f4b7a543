# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Commanders: programs that send motion commands until a test calls ``leave``."""

import math
import threading
from typing import Final, Protocol

from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Odometry
from probe import Probe
from std_srvs.srv import SetBool

DRIVE_HZ: Final = 20.0
FAR_M: Final = 10.0
"""Distance from the robot to the goal, in m for each m/s of the commanded speed.

No test drives far enough to reach a goal.
"""


class Hand(Protocol):
    """The interface of a commander: a program that sends motion commands."""

    def hold(self, vx: float, vy: float, yaw_rate: float) -> None:
        """Command this motion, in m/s and rad/s, until ``leave`` or another ``hold``."""

    def leave(self) -> None:
        """Stop commanding, so that the motion ends."""


class Stick:
    """A commander that publishes a velocity at 20 Hz."""

    def __init__(self, probe: Probe) -> None:
        self._publisher = probe.publisher(Twist, "cmd_vel")
        self._left = threading.Event()
        self._twist = Twist()
        self._thread: threading.Thread | None = None

    def hold(self, vx: float, vy: float, yaw_rate: float) -> None:
        twist = Twist()
        twist.linear.x, twist.linear.y, twist.angular.z = vx, vy, yaw_rate
        self._twist = twist
        if self._thread is None:
            self._left.clear()
            self._thread = threading.Thread(target=self._publish)
            self._thread.start()

    def leave(self) -> None:
        """Stop publishing. No command is published after the return of this method."""
        if self._thread is not None:
            self._left.set()
            self._thread.join()
            self._thread = None

    def _publish(self) -> None:
        while not self._left.wait(1 / DRIVE_HZ):
            self._publisher.publish(self._twist)


class Navigator:
    """A commander that sends a distant goal for each motion.

    ``odom``: the list of received odometry, to which new messages are appended.
    """

    def __init__(self, probe: Probe, odom: list[Odometry]) -> None:
        self._probe, self._odom = probe, odom
        self._goals = probe.publisher(PoseStamped, "cmd_pose")

    def hold(self, vx: float, vy: float, yaw_rate: float) -> None:
        """Send a goal far away in the direction of this velocity."""
        self._probe.wait_for(lambda: self._odom)
        here = self._odom[-1].pose.pose
        yaw = 2 * math.atan2(here.orientation.z, here.orientation.w) + yaw_rate
        goal = PoseStamped()
        goal.header.frame_id = "odom"
        goal.pose.position.x = here.position.x + FAR_M * vx
        goal.pose.position.y = here.position.y + FAR_M * vy
        goal.pose.orientation.z, goal.pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
        self._goals.publish(goal)

    def leave(self) -> None:
        """Latch and release the e-stop. This discards the goal, which has no timeout."""
        for data in (True, False):
            self._probe.call(SetBool, "estop", data=data)
