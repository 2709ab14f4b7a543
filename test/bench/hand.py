# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Command several robots in turn, 40 times a second each.

Arguments: duration in s, and namespaces. Output: a JSON list with one array for each namespace.
The array has an item for each command: (time of the steady clock in s, speed in board units).
"""

import json
import sys
import time

from geometry_msgs.msg import Twist
from publishers import connected

PERIOD_S = 0.0247
"""Period of the commands in s.

It is not a multiple of the board's tick, so the commands are sent at all times within a tick.
"""
FASTEST = 30
LSB_PER_MPS = 70.0


def main() -> None:
    """Command the robots in turn, with the same pause before each command."""
    seconds, namespaces = float(sys.argv[1]), sys.argv[2:]
    publishers = connected(namespaces)
    sent: list[list[tuple[float, int]]] = [[] for _ in namespaces]
    at = begun = time.monotonic()
    speed = 0
    while at < begun + seconds:
        speed = speed % FASTEST + 1
        twist = Twist()
        twist.linear.x = speed / LSB_PER_MPS
        for number, publisher in enumerate(publishers):
            at += PERIOD_S / len(publishers)
            time.sleep(max(0.0, at - time.monotonic()))  # commands have a given rate
            sent[number].append((time.monotonic(), speed))
            publisher.publish(twist)
    print(json.dumps(sent), flush=True)


if __name__ == "__main__":
    main()
