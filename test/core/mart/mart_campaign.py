# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Random drives on networks of all kinds. At the end, the robot rests and the server answers.

``PYTHONPATH=.:test:test/core python test/core/mart/mart_campaign.py 60``: 60 drives for each
network. Results: docs/internals/mart_searches.md.
"""

import argparse
from random import Random
from typing import NamedTuple

from mart_bench import MartBench

from omnibot_driver.simulator.common.network import NetworkFaults
from omnibot_driver.simulator.mart import Firmware

NETWORKS = {
    "good": NetworkFaults(),
    "10 % lost": NetworkFaults(lose=0.1),
    "10 % duplicated, late by up to 0.3 s": NetworkFaults(duplicate=0.1, delay_s=0.3),
    "10 % lost and duplicated, late by up to 0.3 s": NetworkFaults(
        lose=0.1, duplicate=0.1, delay_s=0.3
    ),
    "10 % lost and duplicated, late by up to 50 ms": NetworkFaults(
        lose=0.1, duplicate=0.1, delay_s=0.05
    ),
}
TWISTS = [(0.3, 0.0), (0.2, 0.3), (0.3, -0.4), (0.0, 0.5), (0.0, -0.5), (-0.2, 0.0), (-0.2, 0.2)]
WISHES = 12
FIRMWARES: tuple[Firmware, ...] = ("documented", "firmware", "source")


class Outcome(NamedTuple):
    """The result of one drive.

    * ``ended``: whether the robot rests at the end, and the server answers.
    * ``stop_s``: the longest time in s from a stop of the driver to a standstill of the robot.
    * ``way_m``: the driven distance in m.
    """

    ended: bool
    stop_s: float
    way_m: float


def drive(faults: NetworkFaults, seed: int) -> Outcome:
    """Make a random drive with goals, e-stops and stalls of the driver. Then end the driver."""
    random = Random(seed)
    bench = MartBench(FIRMWARES[seed % 3], faults=faults, seed=seed).ready()
    longest_s = 0.0
    for _ in range(WISHES):
        if random.random() < 0.3:
            here = bench.odometry[-1].pose
            x_m, y_m = (each + random.uniform(-0.6, 0.6) for each in (here.x_m, here.y_m))
            bench.go_to(x_m, y_m, random.uniform(-3.0, 3.0))
            bench.run(random.uniform(0.2, 8.0))
        else:
            bench.command(*random.choice(TWISTS), random.uniform(0.1, 2.5))
        if random.random() < 0.4:
            if random.random() < 0.5:
                bench.estop(True)
            else:
                bench.session.stood_still(1.0, bench.now)
                bench.settle()
            longest_s = max(longest_s, bench.until_it_stands())
            bench.estop(False)
            bench.run(random.uniform(0.0, 1.5))
    bench.session.shutdown.begin(bench.now)
    bench.settle()
    longest_s = max(longest_s, bench.until_it_stands())
    bench.run(3.0)
    lost = bench.board._pilot.lost > 0
    ended = bench.robot.stands and not (bench.server.hung or bench.server.crashed or lost)
    return Outcome(ended, longest_s, bench.server.chassis.way_m)


def main() -> None:
    """Print a row of results for each kind of network."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "drives", nargs="?", type=int, default=20, help="number of drives for each network"
    )
    count = parser.parse_args().drives
    print(
        "| Network | Robot at rest at the end, server answers |"
        " Longest time from a stop to standstill | Mean distance |\n" + "|---" * 4 + "|"
    )
    for name, faults in NETWORKS.items():
        outcomes = [drive(faults, seed) for seed in range(count)]
        stood = sum(outcome.ended for outcome in outcomes)
        longest_s = max(outcome.stop_s for outcome in outcomes)
        way_m = sum(outcome.way_m for outcome in outcomes) / count
        print(f"| {name} | {stood} of {count} | {longest_s:.1f} s | {way_m:.1f} m |", flush=True)


if __name__ == "__main__":
    main()
