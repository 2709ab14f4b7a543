# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Count how often the motion monitor stops robots that obey, in hours of simulated driving.

    PYTHONPATH=test/core .venv/bin/python test/integrity/no_false_trips.py --hours 10

``--first``: seed of the first robot. ``--period``: period of the displacements, in s. The exit code
is 1 when a robot was stopped.
"""

import argparse
import sys
import time

from rough_drive import Outcome, RoughDrive

SECONDS_EACH = 300.0


def main() -> int:
    """Drive all robots and print what happened.

    Return 1 if the monitor stopped a robot; otherwise 0.
    """
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--hours", type=float, default=10.0)
    arguments.add_argument("--first", type=int, default=0)
    arguments.add_argument("--period", type=float, default=0.04)
    chosen = arguments.parse_args()
    robots = round(3600 * chosen.hours / SECONDS_EACH)
    total, begun = Outcome(), time.monotonic()
    for seed in range(chosen.first, chosen.first + robots):
        outcome = RoughDrive(seed, chosen.period).go(SECONDS_EACH)
        total.add(outcome)
        for trip in outcome.trips:
            print(trip, flush=True)
    faster = total.seconds / (time.monotonic() - begun)
    print(
        f"{robots} robots, {total.seconds / 3600:.1f} h, {faster:.0f} times as fast as real time:"
        f" {len(total.trips)} trips"
    )
    for counted in (total.happened, total.said):
        print(", ".join(f"{text}: {count}" for text, count in sorted(counted.items())))
    return 1 if total.trips else 0


if __name__ == "__main__":
    sys.exit(main())
