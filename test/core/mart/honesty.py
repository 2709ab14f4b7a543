# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Measure whether the odometry's covariance covers its error, on networks of all kinds.

The measure is the normalised squared error (NEES), whose mean is 3 for a right covariance.

``PYTHONPATH=.:test:test/core python test/core/mart/honesty.py 50``: 50 drives for each network.
Results: docs/internals/mart_odometry.md.
"""

import argparse
import math
from collections.abc import Iterator
from random import Random
from statistics import mean, median

import numpy as np
from mart_bench import MartBench
from mart_campaign import FIRMWARES, TWISTS

from omnibot_driver.simulator.common.network import NetworkFaults

RARE = 16.3
"""With a consistent covariance, 0.1 % of the normalised squared errors exceed this value."""
NETWORKS = {
    "good": NetworkFaults(),
    "late by up to 0.3 s": NetworkFaults(delay_s=0.3),
    "10 % lost and duplicated, late by up to 50 ms": NetworkFaults(
        lose=0.1, duplicate=0.1, delay_s=0.05
    ),
    "10 % lost and duplicated, late by up to 0.3 s": NetworkFaults(
        lose=0.1, duplicate=0.1, delay_s=0.3
    ),
}
MOTIONS = 6


def nees(bench: MartBench) -> float:
    """Return the normalised squared error of the last published pose.

    The error is the difference between this pose and the true pose.
    """
    told, truth = bench.odometry[-1], bench.truth
    yaw_rad = math.remainder(told.pose.yaw_rad - truth.yaw_rad, math.tau)
    error = np.array([told.pose.x_m - truth.x_m, told.pose.y_m - truth.y_m, yaw_rad])
    c = told.covariance
    covariance = [[c.xx, c.xy, c.x_yaw], [c.xy, c.yy, c.y_yaw], [c.x_yaw, c.y_yaw, c.yaw_yaw]]
    return float(error @ np.linalg.solve(np.array(covariance), error))


def drive(faults: NetworkFaults, seed: int, *, goals: bool = False) -> Iterator[float]:
    """Make a random drive, and yield the normalised squared error at many times during the drive.

    The last value is from the end of the drive.
    """
    random = Random(seed)
    unequal = random.uniform(-0.04, 0.04)
    bench = MartBench(FIRMWARES[seed % 3], faults, seed=seed, motor_inequality=unequal).ready()
    for _ in range(MOTIONS):
        if goals and random.random() < 0.4:
            here = bench.odometry[-1].pose
            x_m, y_m = (each + random.uniform(-0.6, 0.6) for each in (here.x_m, here.y_m))
            bench.go_to(x_m, y_m, random.uniform(-3.0, 3.0))
            for _ in range(int(random.uniform(4.0, 24.0))):
                bench.run(0.5)
                yield nees(bench)
            continue
        twist = random.choice(TWISTS)
        for _ in range(round(random.uniform(20.0, 70.0))):
            bench.try_command(*twist)
            bench.run(0.1)
            if random.random() < 0.2:
                yield nees(bench)
        if random.random() < 0.4:
            for _ in range(8):
                bench.run(0.3)
                yield nees(bench)
    bench.run(3.0)
    yield nees(bench)


def main() -> None:
    """Print a row of results for each kind of network, without and with goals."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "drives", nargs="?", type=int, default=20, help="number of drives for each network"
    )
    count = parser.parse_args().drives
    print(
        "| Network | Motions | Mean at the end | Mean | Median | Beyond 16.3 |\n" + "|---" * 6 + "|"
    )
    for goals in (False, True):
        for name, faults in NETWORKS.items():
            drives = [list(drive(faults, seed, goals=goals)) for seed in range(count)]
            every = [value for each in drives for value in each]
            beyond = sum(value > RARE for value in every) / len(every)
            print(
                f"| {name} | {'with goals' if goals else '`cmd_vel`'} |"
                f" {mean(each[-1] for each in drives):.2f} | {mean(every):.2f} |"
                f" {median(every):.2f} | {100 * beyond:.1f} % |",
                flush=True,
            )


if __name__ == "__main__":
    main()
