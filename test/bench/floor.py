# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The floor: the smallest program that has the same output as the driver, without any checks.

``measurements PORT NAMESPACE``: publish an Imu for every IMU frame, and an Odometry and a
JointState for every delta frame.

``commands PORT NAMESPACE``: write a frame for every cmd_vel.

``bare PORT NAMESPACE``: only create the driver's topics and services.

The benchmark recognizes each Imu and each command by a number in it.
"""

import os
import struct
import sys
import termios

import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import Imu, JointState

IMU, DELTA, POSE = 0xFA, 0xFB, 0xFC
LENGTHS = {IMU: 14, DELTA: 9, POSE: 15}


def measurements(port: int, node: Node) -> None:
    """Read frames, and publish a prepared message for each of them."""
    imus = node.create_publisher(Imu, "imu/data_raw", 10)
    odometries = node.create_publisher(Odometry, "odom", 10)
    joints = node.create_publisher(JointState, "joint_states", 10)
    imu, odometry = Imu(), Odometry(child_frame_id="base_link")
    imu.header.frame_id, odometry.header.frame_id = "imu_link", "odom"
    names = ["wheel_a_joint", "wheel_b_joint", "wheel_c_joint"]
    joint = JointState(name=names, position=[0.0] * 3, velocity=[0.0] * 3)
    number = struct.Struct(">h").unpack_from
    termios.tcflush(port, termios.TCIFLUSH)
    begun = b""
    while data := os.read(port, 4096):
        at, data = 0, begun + data
        while at + 1 < len(data) and at + LENGTHS.get(kind := data[at + 1], 1) <= len(data):
            if kind == IMU:
                imu.linear_acceleration.x = float(number(data, at + 2)[0])
                imus.publish(imu)
            elif kind == DELTA:
                odometries.publish(odometry)
                joints.publish(joint)
            at += LENGTHS.get(kind, 1)  # skip a byte: the first read began within a frame
        begun = data[at:]


def commands(port: int, node: Node) -> None:
    """Write one frame for each command, in the callback of the command."""
    pack = struct.Struct(">BBBhhh").pack

    def drive(twist: Twist) -> None:
        os.write(port, pack(0xFF, 0xFE, 1, round(70.0 * twist.linear.x), 0, 0))

    node.create_subscription(Twist, "cmd_vel", drive, 1)
    rclpy.spin(node)


def bare(_port: int, node: Node) -> None:
    """Create the same topics and services as the driver, but with callbacks that do nothing."""
    from diagnostic_msgs.msg import DiagnosticArray  # the other floors do not need these
    from rclpy.executors import SingleThreadedExecutor
    from std_msgs.msg import Bool, Float32MultiArray, String
    from std_srvs.srv import SetBool, Trigger

    outputs = {
        "imu/data_raw": Imu,
        "odom": Odometry,
        "joint_states": JointState,
        "~/state": String,
        "~/estop_active": Bool,
        "/diagnostics": DiagnosticArray,
    }
    for topic, kind in outputs.items():
        node.create_publisher(kind, topic, 10)
    for topic, kind in {"cmd_vel": Twist, "wheel_cmd": Float32MultiArray, "estop": Bool}.items():
        node.create_subscription(kind, topic, lambda _message: None, 10)
    for name in ("estop", "pause", "start", "reset", "reset_odometry", "calibrate_gyro"):
        kind = SetBool if name in ("estop", "pause") else Trigger
        node.create_service(kind, f"~/{name}", lambda _request, response: response)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    executor.spin()


def main() -> None:
    """Relay data until the serial line is closed at its other end, or the process is killed."""
    what, path, namespace = sys.argv[1:]
    port = os.open(path, os.O_RDWR | os.O_NOCTTY)
    rclpy.init()
    quiet = {"start_parameter_services": False, "enable_rosout": False}
    node = Node("floor", namespace=namespace, **({} if what == "bare" else quiet))
    {"measurements": measurements, "commands": commands, "bare": bare}[what](port, node)


if __name__ == "__main__":
    main()
