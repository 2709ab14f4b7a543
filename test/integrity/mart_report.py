# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Integrity of the values published for a MART controller on a bad network (``make integrity``).

The simulated controller shares no code with the driver. A pose is wrong if its normalised squared
error (NEES) is larger than 28.
"""

import math
import os
import sys
from collections import Counter
from dataclasses import dataclass, field
from functools import partial
from multiprocessing import Pool
from pathlib import Path
from random import Random
from typing import Final

TEST: Final = Path(__file__).parents[1]
sys.path[:0] = [str(TEST), str(TEST / "core"), str(TEST / "core" / "mart")]

from honesty import nees  # noqa: E402
from mart_bench import MartBench  # noqa: E402
from mart_campaign import FIRMWARES, TWISTS  # noqa: E402

from omnibot_driver.core.mart.readings import (  # noqa: E402
    BatteryReading,
    DockedReading,
    SonarReading,
)
from omnibot_driver.simulator.common.network import NetworkFaults  # noqa: E402

DRIVES_PER_SEED: Final = 3
"""Number of drives per seed: one for each variant of the server."""
FAULTS: Final = {
    "none": NetworkFaults(),
    "1 in 10 lost": NetworkFaults(lose=0.1),
    "1 in 3 lost": NetworkFaults(lose=0.33),
    "1 in 10 doubled, late by up to 50 ms": NetworkFaults(duplicate=0.1, delay_s=0.05),
    "late by up to 0.3 s": NetworkFaults(delay_s=0.3),
    "1 in 10 lost and doubled, late by up to 50 ms": NetworkFaults(
        lose=0.1, duplicate=0.1, delay_s=0.05
    ),
    "1 in 10 lost and doubled, late by up to 0.3 s": NetworkFaults(
        lose=0.1, duplicate=0.1, delay_s=0.3
    ),
}
WRONG_NEES: Final = 28.0
"""Largest normalised squared error (NEES) of a pose that counts as right.

If the covariances are right, 1 pose in 270,000 has a larger error by chance.
"""
WRONG_M, WRONG_V = 0.08, 0.1
FRONT_M, VOLTS = 5.0, 23.4
STAY_M: Final = 1.5
"""Distance of the robot from its start, in m, beyond which only turns are commanded.

Otherwise the robot might reach the wall.
"""


@dataclass(slots=True)
class Score:
    """Counts of published messages of each kind. Scores can be added.

    ``stood``: number of drives at whose end the robot was at rest.
    """

    published: Counter[str] = field(default_factory=Counter)
    wrong: Counter[str] = field(default_factory=Counter)
    way_m: float = 0.0
    stood: int = 0

    def __iadd__(self, other: "Score") -> "Score":
        self.published += other.published
        self.wrong += other.wrong
        self.way_m += other.way_m
        self.stood += other.stood
        return self

    def count(self, kind: str, wrong: bool) -> None:
        """Count one published message of ``kind``. ``wrong``: whether its value is wrong."""
        self.published[kind] += 1
        self.wrong[kind] += wrong


def drive(name: str, seconds: float, seed: int) -> Score:
    """Drive random motions with periods of rest between them, and return the score.

    While the robot is at rest, the driver polls sonars and battery.
    """
    random, score = Random(f"{name} {seed}"), Score()
    bench = MartBench(
        FIRMWARES[seed % 3],
        FAULTS[name],
        seed=seed,
        motor_inequality=random.uniform(-0.04, 0.04),
        front_m=FRONT_M,
        volts=VOLTS,
    ).ready()
    until_s = bench.now + seconds
    while bench.now < until_s:
        twist = random.choice(TWISTS)
        if bench.truth.way_m > STAY_M:
            twist = (0.0, 0.5)
        for _ in range(random.randrange(20, 60)):
            bench.try_command(*twist)
            _watch(bench, score)
        for _ in range(random.randrange(5, 25)):
            _watch(bench, score)
    bench.run(3.0)
    _watch(bench, score)
    score.stood = bench.robot.stands and not bench.server.hung
    score.way_m = bench.server.chassis.way_m
    return score


def _watch(bench: MartBench, score: Score) -> None:
    """Run for 0.1 s, and count right and wrong messages.

    An odometry message is compared with the true pose at its publication, all others with the true
    values at the end.
    """
    seen = len(bench.events)
    for _ in range(10):
        told = len(bench.odometry)
        bench.run(0.01)
        if len(bench.odometry) > told:
            score.count("odom", nees(bench) > WRONG_NEES)
    truth = bench.truth
    for event in bench.events[seen:]:
        value = getattr(event, "value", None)
        if isinstance(value, BatteryReading):
            score.count("battery_state", abs(value.volts - VOLTS) > WRONG_V)
        elif isinstance(value, DockedReading):
            score.count("docked", value.docked)
        elif isinstance(value, SonarReading):
            score.count(f"range/{value.side}", not _is_true(value, truth.x_m, truth.yaw_rad))


def _is_true(sonar: SonarReading, x_m: float, yaw_rad: float) -> bool:
    """Return whether a sonar's range agrees with the true distance to the wall.

    The wall is in front of the robot's start.

    From 254 inches on, the sonar reports -1.
    """
    ahead = math.cos(yaw_rad) if sonar.side == "front" else -math.cos(yaw_rad)
    sees_m = (FRONT_M - x_m) / ahead if ahead > 0.3 else math.inf
    if math.isinf(sonar.distance_m):
        return sees_m > 6.2 or abs(ahead) < 0.4
    return abs(sonar.distance_m - sees_m) < WRONG_M + 0.03 * sonar.distance_m


def measure(seconds: float, seeds: range) -> tuple[list[str], bool]:
    """Return the rows of the table, and whether nothing was wrong and every robot came to rest."""
    drives = range(seeds.start, seeds.start + DRIVES_PER_SEED * len(seeds))
    lines = [
        f"{len(drives)} drives of {seconds:g} s on each network:",
        "",
        "| datagrams | stood at the end | way | `odom` wrong | `battery_state` | `range/*` |"
        " `docked` |",
        "|---" * 7 + "|",
    ]
    all_hold = True
    with Pool(os.cpu_count()) as pool:
        for name in FAULTS:
            score = Score()
            for each in pool.imap_unordered(partial(drive, name, seconds), drives):
                score += each
            lines.append(_row(name, score, len(drives)))
            all_hold &= score.stood == len(drives) and not sum(score.wrong.values())
    return lines, all_hold


def _row(name: str, score: Score, drives: int) -> str:
    def wrong(*kinds: str) -> str:
        bad = sum(score.wrong[kind] for kind in kinds)
        return f"{bad} of {sum(score.published[kind] for kind in kinds):,}"

    return (
        f"| {name} | {score.stood} of {drives} | {score.way_m / drives:.1f} m | {wrong('odom')} |"
        f" {wrong('battery_state')} | {wrong('range/front', 'range/rear')} | {wrong('docked')} |"
    )
