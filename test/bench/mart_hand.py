# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Commands two MART robots in turn: another speed once a second, sometimes zero.

Arguments: seconds, namespaces. The program prints one JSON array per namespace, of pairs: the
steady clock's time in s at which a speed was first published, and the speed in m/s.
"""

import json
import sys
import time

from geometry_msgs.msg import Twist
from publishers import connected

SPEEDS = (0.15, 0.35, 0.2, 0.4, 0.15, 0.3, 0.0, 0.0)
"""Commanded speeds in m/s; the zeros at the end last until the robot can be started anew."""
HOLD_S, REPEAT_S = 1.0, 0.1
AHEAD_S = 3.0


def main() -> None:
    """Command each speed to both robots in turn; record when each speed was first published."""
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
