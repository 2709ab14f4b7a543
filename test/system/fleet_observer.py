# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Program that waits until it has found all drivers of a fleet through a discovery server.

Run ``python fleet_observer.py COUNT PREFIX`` with ``ROS_SUPER_CLIENT`` set. Tests run this program
as a process of its own: with Fast DDS, a process that becomes a client of a discovery server can no
longer find nodes that use no server.
"""

import sys

import rclpy

from omnibot_driver.tools.drivers import running_drivers


def main(count: int, prefix: str) -> None:
    """Wait until exactly the ``count`` drivers of the fleet are discovered."""
    wanted = {f"/{prefix}{number}/omnibot_driver" for number in range(count)}
    rclpy.init()
    node = rclpy.create_node("observer")
    while set(running_drivers(node)) != wanted:
        rclpy.spin_once(node, timeout_sec=0.1)
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
