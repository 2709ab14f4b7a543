# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Program that imports the driver once and runs several drivers, each in a separate process.

``python fleet_of_drivers.py NUMBER PREFIX`` prints the process ids of NUMBER drivers, which are
in the namespaces ``/PREFIX0``, ``/PREFIX1`` and so on. Their port does not exist. The program ends
the drivers when its standard input is closed.
"""

import os
import signal
import sys

import rclpy
from rclpy.executors import SingleThreadedExecutor

from omnibot_driver.node import OmniBotDriver


def drive(name: str) -> None:
    """Run the driver in the namespace ``name`` until this process is killed."""
    arguments = ["-r", f"__ns:=/{name}", "-p", "port:=/dev/no_such_port", "-p", "guard:=false"]
    rclpy.init(args=["--ros-args", *arguments])
    executor = SingleThreadedExecutor()
    executor.add_node(OmniBotDriver())
    executor.spin()


def main() -> None:
    """Fork the drivers, print their process ids, and kill them when the standard input ends."""
    children = []
    for index in range(int(sys.argv[1])):
        if not (child := os.fork()):
            drive(f"{sys.argv[2]}{index}")
            os._exit(0)
        children.append(child)
    print(*children, flush=True)
    sys.stdin.read()
    for child in children:
        os.kill(child, signal.SIGKILL)
    for child in children:
        os.waitpid(child, 0)


if __name__ == "__main__":
    main()
