# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The floor for a LOIS ECU: the smallest program with the same output, without any checks.

Arguments: PORT NAMESPACE. The program publishes an Odometry and a JointState for every group of
lines, and writes a line for every cmd_vel.
"""

import math
import os
import sys
import threading

import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import JointState

WHEEL_RADIUS_M = 0.13
RPM_PER_MPS = 60.0 / math.tau / WHEEL_RADIUS_M


def rpm_line(speed_mps: float) -> bytes:
    """Return the command that turns both wheels forward at ``speed_mps``."""
    text = f":02{2 * f'{round(RPM_PER_MPS * speed_mps):04x}'}".encode()
    check = 0
    for character in text:
        check ^= character
    return b"%s%02x\n" % (text, check)


def relay(port: int, node: Node) -> None:
    """Read lines, and publish prepared messages for each group of odometry reports."""
    odometries = node.create_publisher(Odometry, "odom", 10)
    joints = node.create_publisher(JointState, "joint_states", 10)
    odometry = Odometry(child_frame_id="base_link")
    joint = JointState(name=["left_wheel_joint", "right_wheel_joint"], position=[0.0] * 2)
    while data := os.read(port, 4096):
        for _ in range(data.count(b":20ffffffff")):
            odometries.publish(odometry)
            joints.publish(joint)


def main() -> None:
    """Relay data until the serial line is closed at its other end, or the process is killed."""
    path, namespace = sys.argv[1:]
    port = os.open(path, os.O_RDWR | os.O_NOCTTY)
    rclpy.init()
    node = Node("floor", namespace=namespace, start_parameter_services=False, enable_rosout=False)
    node.create_subscription(
        Twist, "cmd_vel", lambda twist: os.write(port, rpm_line(twist.linear.x)), 1
    )
    threading.Thread(target=relay, args=(port, node), daemon=True).start()
    rclpy.spin(node)


if __name__ == "__main__":
    main()
