# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The floor for a MART: the smallest program with the same output, without any checks.

``HOST PORT NAMESPACE``: query encoder and heading 16 times a second each; publish an Odometry and a
JointState for each encoder count; send RM or RMCS for every cmd_vel.
"""

import socket
import sys
import threading
import time

import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import JointState

PERIOD_S = 0.03
MPS_PER_UNIT = 0.0078


class Relay:
    def __init__(self, address: tuple[str, int], node: Node) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(address)
        self._units = 0
        self._odometries = node.create_publisher(Odometry, "odom", 10)
        self._joints = node.create_publisher(JointState, "joint_states", 10)

    def command(self, twist: Twist) -> None:
        """Change the speed of both motors, or start them if they are at rest."""
        units = round(twist.linear.x / MPS_PER_UNIT)
        if self._units:
            self._socket.send(b"RMCS %d %d" % (units - self._units, units - self._units))
        else:
            self._socket.send(b"RM %d" % units)
        self._units = units

    def ask(self) -> None:
        """Query the encoder and the heading in turn."""
        while True:
            for word in (b"ENC", b"RMRA"):
                self._socket.send(word)
                time.sleep(PERIOD_S)  # the rate of the queries is part of the floor

    def listen(self) -> None:
        """Receive replies. For each encoder count, publish an Odometry and a JointState.

        The content of the two messages never changes.
        """
        odometry = Odometry(child_frame_id="base_link")
        joint = JointState(name=["left_wheel_joint", "right_wheel_joint"], position=[0.0] * 2)
        while True:
            data = self._socket.recv(512)
            if b"." not in data:
                self._odometries.publish(odometry)
                self._joints.publish(joint)


def main() -> None:
    """Relay data between the controller and ROS until the process is killed."""
    host, port, namespace = sys.argv[1:]
    rclpy.init()
    node = Node("floor", namespace=namespace, start_parameter_services=False, enable_rosout=False)
    relay = Relay((host, int(port)), node)
    node.create_subscription(Twist, "cmd_vel", relay.command, 1)
    for work in (relay.ask, relay.listen):
        threading.Thread(target=work, daemon=True).start()
    rclpy.spin(node)


if __name__ == "__main__":
    main()
