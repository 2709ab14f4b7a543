# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A super client of a discovery server, which ends when it has found all drivers of a fleet.

``python fleet_observer.py COUNT PREFIX``. It is a process of its own, because Fast DDS finds
nothing without a server in a process that has been a client of one.
"""

import sys

import rclpy

from omnibot_driver.tools.drivers import running_drivers


def main(count: int, prefix: str) -> None:
    """Spin until each driver of the fleet is discovered."""
    wanted = {f"/{prefix}{number}/omnibot_driver" for number in range(count)}
    rclpy.init()
    node = rclpy.create_node("observer")
    while set(running_drivers(node)) != wanted:
        rclpy.spin_once(node, timeout_sec=0.1)
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
