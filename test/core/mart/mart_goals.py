# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Goals on a network with faults: helpers of the tests, and a measurement of many goals.

``PYTHONPATH=.:test:test/core python test/core/mart/mart_goals.py 25``: 25 runs with 4 goals each,
for each network. Results: docs/internals/mart_protocol.md.
"""

import argparse
import math
from collections.abc import Callable
from random import Random

from mart_bench import MartBench

from omnibot_driver.core.events import Notice
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.simulator.common.network import NetworkFaults, NetworkPath
from omnibot_driver.simulator.mart import Firmware

NETWORKS = {
    "good": NetworkFaults(),
    "late by up to 0.1 s": NetworkFaults(delay_s=0.1),
    "late by up to 0.3 s": NetworkFaults(delay_s=0.3),
    "3 % lost, late by up to 0.1 s": NetworkFaults(lose=0.03, delay_s=0.1),
    "10 % lost, late by up to 50 ms": NetworkFaults(lose=0.1, delay_s=0.05),
    "3 % lost and duplicated, late by up to 0.1 s": NetworkFaults(
        lose=0.03, duplicate=0.03, delay_s=0.1
    ),
}
NEAR_M = 0.12
GOALS = 4

EVERY_FIRMWARE: list[Firmware] = ["documented", "firmware", "source"]


def on(
    network: NetworkFaults, firmware: Firmware, seed: int = 0, after_s: float = 0.0
) -> MartBench:
    """Return a bench that is ready to drive, with the faults ``network`` in its network.

    ``after_s``: time in s from when the bench is ready until the faults begin.
    """
    bench = MartBench(firmware, seed=seed).ready()
    bench.run(after_s)
    for channel in bench.robot.network:
        channel.to_board._faults = channel.from_board._faults = network
    return bench


def reach(bench: MartBench, goal: Pose) -> str:
    """Command the goal. Wait until its progress is "over", or the session has dropped the goal.

    Return the texts of all notices that came in this time, joined to one text.
    """
    since, pilot = len(bench.events), bench.board._pilot

    def ended() -> bool:
        return pilot.goal_progress.startswith("over") or not holds_command(bench)

    bench.go_to(goal.x_m, goal.y_m, goal.yaw_rad)
    bench.run(0.1)
    bench.run_until(ended, 120.0)
    bench.run(3.0)
    assert bench.robot.stands
    return " ".join(each.text for each in bench.events[since:] if isinstance(each, Notice))


def holds_command(bench: MartBench) -> bool:
    """Return whether the session still has a command: no fault and no stop has ended it."""
    return bench.session._commands.current is not None


def first_distance(bench: MartBench, x_m: float) -> int:
    """Command a goal ahead or behind. Return the length of the first straight move, in inches."""
    since = len(bench.written)
    bench.go_to(x_m, 0.0, 0.0)

    def straight() -> list[bytes]:
        return [data for data in bench.said(since) if data.startswith(b"TF")]

    bench.run_until(lambda: bool(straight()), 30.0)
    return int(straight()[0].split()[-1])


def yaw_error(bench: MartBench) -> float:
    """Return the absolute error of the odometry's heading, in rad."""
    return abs(math.remainder(bench.error.yaw_rad, math.tau))


def drops(path: NetworkPath, lost: Callable[[bytes], bool]) -> list[bytes]:
    """Let ``path`` lose each datagram for which ``lost`` is true. Return the lost datagrams.

    The returned list grows with each lost datagram.
    """
    gone, real = list[bytes](), path.send

    def send(data: bytes, at_s: float) -> None:
        if lost(data):
            gone.append(data)
        else:
            real(data, at_s)

    path.send = send  # type: ignore[method-assign]
    return gone


def random_goal(random: Random) -> Pose:
    return Pose(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-3, 3))


def main() -> None:
    """Print a row of results for each kind of network."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "runs", nargs="?", type=int, default=10, help="number of runs for each network"
    )
    count = parser.parse_args().runs
    print(
        "| Network | Goals reached | Discarded | Largest error of the odometry |\n"
        + "|---" * 4
        + "|"
    )
    for name, faults in NETWORKS.items():
        reached = discarded = 0
        worst_m = 0.0
        for seed in range(count):
            random = Random(seed)
            # else, the first goal would always come at the same phase of the queries
            bench = on(faults, EVERY_FIRMWARE[seed % 3], seed, random.uniform(0.0, 2.0))
            for _ in range(GOALS):
                goal = random_goal(random)
                reach(bench, goal)
                discarded += not holds_command(bench)
                reached += bench.truth.way_to(goal).way_m < NEAR_M
                worst_m = max(worst_m, bench.error.way_m)
        goals = GOALS * count
        print(f"| {name} | {reached} of {goals} | {discarded} | {worst_m:.2f} m |", flush=True)


if __name__ == "__main__":
    main()
