# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A bounded search that drives the real pilot and conversation against the simulated firmware.

``mart_model`` searches without a bound, but with a driver of its own. Here what runs is what is
searched: every pair of wishes, with one datagram of either way lost, late or doubled, whichever it
is; and every driver that begins, whatever the robot does then, with a network that is away for any
time. ``PYTHONPATH=.:test:test/core python test/core/mart/real_search.py`` does all of it.
"""

import heapq
import os
import sys
from collections.abc import Callable, Iterator
from itertools import count, product
from multiprocessing import Pool
from typing import Final, Literal, NamedTuple

from mart_bench import POLLS, MartBench

from omnibot_driver.core.packets import Packet

Fate = Literal["lost", "late", "twice"]
FATES: Final[tuple[Fate, ...]] = ("lost", "late", "twice")
LATE_S: Final = 0.29
"""The network delay that the driver assumes, less a tick."""
WISHES: Final[dict[str, Callable[[MartBench], object]]] = {
    "forward": lambda bench: bench.command(0.3, 0.1, 0.7),
    "backward": lambda bench: bench.command(-0.2, 0.1, 0.8),
    "left": lambda bench: bench.command(0.0, 0.5, 0.8),
    "goal ahead": lambda bench: (bench.go_to(*_ahead(bench)), bench.run(1.2)),
    "goal behind": lambda bench: (bench.go_to(0.0, 0.0, 2.0), bench.run(1.2)),
    "stop": lambda bench: bench.run(0.7),
    "e-stop": lambda bench: (bench.estop(True), bench.run(0.4), bench.estop(False)),
}
MOST_DATAGRAMS: Final = 14
"""Each way, from the first wish on, without the polls."""
MET: Final = (b"", b"RM 30", b"B SLOW", b"L SLOW", b"TF 300", b"MCR 350")
"""What a driver may meet that begins."""
AWAY_S: Final = tuple(n / 5 for n in range(0, 41))
"""Times after which the network comes back."""
BACK_S: Final = (0.2, 0.7, 30.0)
"""Times after which it is away again, for a second."""
ENDS_S: Final = 16.0


class Trial(NamedTuple):
    """``met``, ``away_s``, ``back_s``, ``ways`` of a driver that begins; else two ``wishes``, and
    which datagram of which way meets which fate.
    """

    wishes: tuple[str, ...] = ()
    way: int = 0
    number: int = -1
    fate: Fate = "lost"
    met: bytes = b""
    away_s: float = 0.0
    back_s: float = 30.0
    ways: tuple[int, ...] = (0, 1)


class Carrier:
    """In place of the robot's network: what it does to each datagram is known before."""

    def __init__(self, bench: MartBench, trial: Trial) -> None:
        self.robot, self.trial = bench.robot, trial
        self.board = bench.robot.board
        self.numbers = [-1, -1]
        self.counting = False
        self._late: list[tuple[float, int, int, Packet]] = []
        self._order = count()

    @property
    def stands(self) -> bool:
        return bool(self.robot.stands)

    @property
    def way_m(self) -> float:
        return float(self.robot.way_m)

    def _away(self, way: int) -> bool:
        trial, now_s = self.trial, self.board.now_s
        away = now_s < trial.away_s or trial.back_s <= now_s - trial.away_s < trial.back_s + 1.0
        return away and way in trial.ways

    def _put(self, way: int, packet: Packet, poll: bool) -> None:
        now_s = self.board.now_s
        if self._away(way):
            return
        if self.counting and not poll:
            self.numbers[way] += 1
        chosen = self.counting and not poll and (way, self.numbers[way]) == self.trial[1:3]
        times_s = [now_s]
        if chosen:
            late_s = now_s + LATE_S
            times_s = {"lost": [], "late": [late_s], "twice": [now_s, late_s]}[self.trial.fate]
        for at_s in times_s:
            heapq.heappush(self._late, (at_s, next(self._order), way, packet))

    def receive(self, data: bytes, now: float, channel: int) -> None:
        self._put(0, (channel, data), data in POLLS)

    def advance(self) -> list[Packet]:
        out: list[Packet] = []
        for _ in range(5):
            for channel, data in self.board.advance():
                self._put(1, (channel, data), data[3:4].isdigit() or data[3:4] == b"-")
            while self._late and self._late[0][0] <= self.board.now_s:
                _, _, way, (channel, data) = heapq.heappop(self._late)
                if way:
                    out.append((channel, data))
                else:
                    self.board.receive(data, self.board.now_s, channel)
        return out


def _ahead(bench: MartBench) -> tuple[float, float, float]:
    pose = bench.odometry[-1].pose if bench.odometry else bench.truth
    return pose.x_m + 0.5, pose.y_m, 0.0


def pairs() -> Iterator[Trial]:
    """Every pair of wishes, with each fate of each datagram."""
    for pair in product(WISHES, WISHES):
        for way, number, fate in product((0, 1), range(MOST_DATAGRAMS), FATES):
            yield Trial(pair, way, number, fate)


def beginnings() -> Iterator[Trial]:
    """Every driver that begins while the network is away."""
    for met, away_s, back_s in product(MET, AWAY_S, BACK_S):
        for ways in ((0, 1), (0,), (1,)):
            yield Trial(met=met, away_s=away_s, back_s=back_s, ways=ways)


def trouble(trial: Trial) -> str:
    """What must not be; empty where it is not. With a living IMU throughout."""
    bench = MartBench("firmware", seed=3)
    carrier = Carrier(bench, trial)
    bench.robot = carrier
    if trial.met:
        bench.server.receive(trial.met, 0, None, 0.0)
    if trial.wishes:
        bench.ready()
        carrier.counting = True
        for wish in trial.wishes:
            WISHES[wish](bench)
        bench.run(2.0)
        bench.estop(True)  # a goal goes on without anybody
        bench.run(3.0)
    else:
        bench.open()
        bench.run(trial.away_s + ENDS_S)
    if bench.server.hung or bench.server.crashed or (trial.wishes and bench.server.stop_port_hung):
        return "the server hangs"
    if not bench.robot.stands:
        return "the robot moves"
    if trial.wishes and any(notice.startswith("lost") for notice in bench.notices):
        return "the server is given up"
    return ""


def search(trials: list[Trial]) -> list[tuple[Trial, str]]:
    """Those that end badly."""
    with Pool(os.cpu_count()) as pool:
        found = pool.map(trouble, trials, chunksize=8)
    return [(trial, why) for trial, why in zip(trials, found, strict=True) if why]


def main() -> None:
    """Both, or those named: ``pairs``, ``beginnings``."""
    for name in sys.argv[1:] or ("pairs", "beginnings"):
        trials = list({"pairs": pairs, "beginnings": beginnings}[name]())
        bad = search(trials)
        print(f"{name}: {len(trials)} trials, {len(bad)} end badly")
        for trial, why in bad[:20]:
            print(f"  {why}: {trial}")


if __name__ == "__main__":
    main()
