# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Pictures of the report on a recorded drive: the demo's square, with an e-stop."""

import math
import os
import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

os.environ.setdefault("ROS_DOMAIN_ID", "96")
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

import rclpy
from bag import Recorder, as_recorded
from driver_process import Driver
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from probe import Probe
from rclpy.qos import QoSProfile
from rosbags.rosbag2 import StoragePlugin
from std_srvs.srv import SetBool

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.demo.square import steer
from omnibot_driver.tools.report.__main__ import main as report

SHOWN = ("path", "timeline", "timing", "velocities")
REST = 75
"""Number of odom messages during each standstill. A standstill lasts three seconds."""
STOPPED_ON_LEG = 6


def main(folder: Path) -> None:
    """Write ``report_path.png`` and the report's other pictures, and print its verdict."""
    rclpy.init()
    with ExitStack() as stack:
        stack.callback(rclpy.shutdown)
        driver = stack.enter_context(Driver(port="sim://?seed=1"))
        probe = stack.enter_context(Probe.of(driver))
        bag = Path(stack.enter_context(tempfile.TemporaryDirectory())) / "square"
        probe.wait_for_state("nominal")
        recorder = Recorder(probe)
        recorder.record("imu/data_raw", "odom", "joint_states", "omnibot_driver/estop_active")
        _drive(probe, recorder, driver.namespace)
        recorder.write(bag, StoragePlugin.MCAP)
        report([str(bag), "--output", str(bag.parent / "report")])
        for name in SHOWN:
            picture = (bag.parent / "report" / f"{name}.png").read_bytes()
            (folder / f"report_{name}.png").write_bytes(picture)


def _drive(probe: Probe, recorder: Recorder, namespace: str) -> None:
    """Rest, drive seven sides of squares with an e-stop on the last side, and rest again."""
    topic, kind, qos = f"/{namespace}/cmd_vel", "geometry_msgs/msg/Twist", QoSProfile(depth=10)
    recorder.types[topic], recorder.offered[topic] = kind, as_recorded(qos)
    recorder.hear(topic, kind, qos)
    publisher = probe.publisher(Twist, "cmd_vel", qos)
    odom = probe.listen(Odometry, "odom")

    def wait(messages: int) -> None:
        until = len(odom) + messages
        probe.wait_for(lambda: len(odom) >= until)

    def steer_until(done: Callable[[], bool]) -> None:
        nonlocal leg
        while not done():
            leg, told = steer(_pose(odom[-1]), leg)
            message = Twist()
            message.linear.x, message.linear.y = told.vx_mps, told.vy_mps
            message.angular.z = told.yaw_rate_radps
            publisher.publish(message)
            wait(1)

    leg = 0
    wait(REST)
    steer_until(lambda: leg == STOPPED_ON_LEG and _pose(odom[-1]).x_m < 0.5)
    assert probe.call(SetBool, "estop", data=True).success
    released = len(odom) + REST
    steer_until(lambda: len(odom) >= released)
    assert probe.call(SetBool, "estop", data=False).success
    steer_until(lambda: leg > STOPPED_ON_LEG)
    publisher.publish(Twist())
    wait(REST)


def _pose(message: Odometry) -> Pose:
    place, turn = message.pose.pose.position, message.pose.pose.orientation
    return Pose(place.x, place.y, 2 * math.atan2(turn.z, turn.w))
