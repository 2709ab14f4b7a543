# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A subscriber in its own process: it records each Imu and Odometry until stdin is closed.

Arguments: namespaces. Output: a JSON object with two arrays for each namespace. Times are of the
steady clock, in s.

``heard``: [time, acceleration along x] of each Imu.

``odometries``: [time] of each Odometry.
"""

import json
import sys
import threading
import time
from contextlib import suppress
from functools import partial

import rclpy
from nav_msgs.msg import Odometry
from rclpy._rclpy_pybind11 import RCLError
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import Imu, JointState


def main() -> None:
    """Record the measurements of every namespace until stdin is closed, then print their times."""
    namespaces = sys.argv[1:]
    rclpy.init()
    node = Node("ear", start_parameter_services=False, enable_rosout=False)
    heard: list[list[tuple[float, float]]] = [[] for _ in namespaces]
    odometries: list[list[tuple[float]]] = [[] for _ in namespaces]

    def hear(number: int, imu: Imu) -> None:
        heard[number].append((time.monotonic(), imu.linear_acceleration.x))

    def count(number: int, _odometry: Odometry) -> None:
        odometries[number].append((time.monotonic(),))

    for number, namespace in enumerate(namespaces):
        node.create_subscription(Imu, f"{namespace}/imu/data_raw", partial(hear, number), 100)
        node.create_subscription(Odometry, f"{namespace}/odom", partial(count, number), 100)
        node.create_subscription(JointState, f"{namespace}/joint_states", lambda _joints: None, 100)
    threading.Thread(target=lambda: (sys.stdin.read(), rclpy.shutdown()), daemon=True).start()
    print("listening", flush=True)
    with suppress(ExternalShutdownException, RCLError):  # shut down while waiting or working
        rclpy.spin(node)
    print(json.dumps({"heard": heard, "odometries": odometries}), flush=True)


if __name__ == "__main__":
    main()
