# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Command several MART robots with the same speed, which changes every 1 to 3 s and may be zero.

Arguments: duration in s, and namespaces. Output: a JSON list with one array for each namespace.
The array has an item for each speed: (time of its first message by the steady clock in s, speed in
m/s).
"""

import json
import sys
import time

from geometry_msgs.msg import Twist
from publishers import connected

SPEEDS = (0.15, 0.35, 0.2, 0.4, 0.15, 0.3, 0.0, 0.0)
"""Speeds in m/s that are commanded in this order, again and again.

The robot comes to rest during the two zeros, so that it can start again.
"""
HOLD_S, REPEAT_S = 1.0, 0.1
AHEAD_S = 3.0


def main() -> None:
    """Command all robots with the speeds in ``SPEEDS``, one speed after the other, again and again.

    For each robot, record the time of the first message with each new speed, and the speed.
    """
    seconds, namespaces = float(sys.argv[1]), sys.argv[2:]
    publishers = connected(namespaces)
    sent: list[list[tuple[float, float]]] = [[] for _ in namespaces]
    begun, number = time.monotonic(), 0
    while time.monotonic() < begun + seconds:
        twist = Twist()
        twist.linear.x = SPEEDS[number % len(SPEEDS)]
        until = time.monotonic() + (AHEAD_S if number % len(SPEEDS) == 0 else HOLD_S)
        until += 0.0137 * (number % 7)  # not a multiple of any poll's period
        first = True
        while time.monotonic() < until:
            for which, publisher in enumerate(publishers):
                if first:
                    sent[which].append((time.monotonic(), twist.linear.x))
                publisher.publish(twist)
            first = False
            time.sleep(REPEAT_S)  # the rate of a node that commands a robot
        number += 1
    print(json.dumps(sent), flush=True)


if __name__ == "__main__":
    main()
