# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A bounded search that runs the real driver against the simulated firmware, in many trials.

In most trials, a user gives commands (*wishes*), and one datagram has a *fate*: it is lost, late or
doubled, or the IMU dies when the datagram is sent. In the others, a driver starts while the server
may be executing a command.

``PYTHONPATH=.:test:test/core python test/core/mart/real_search.py`` runs all sets of trials.
"""

import argparse
import copy
import heapq
import math
import os
import time
from collections.abc import Callable, Iterator
from functools import cache
from itertools import product
from multiprocessing import Pool
from typing import Final, Literal, NamedTuple

from mart_bench import POLLS, MartBench, sleeps

from omnibot_driver.core.mart import words
from omnibot_driver.core.packets import Packet

Fate = Literal["lost", "late", "twice", "the IMU dies"]
FATES: Final[tuple[Fate, ...]] = ("lost", "late", "twice", "the IMU dies")
LATE_S: Final = 0.29
"""Delay of a late datagram, in s: one tick less than the longest delay that the driver assumes."""
WISHES: Final[dict[str, Callable[[MartBench], object]]] = {
    "forward": lambda bench: bench.command(0.3, 0.1, 0.7),
    "backward": lambda bench: bench.command(-0.2, 0.1, 0.8),
    "left": lambda bench: bench.command(0.0, 0.5, 0.8),
    "goal ahead": lambda bench: (bench.go_to(*_ahead(bench)), bench.run(1.2)),
    "goal behind": lambda bench: (bench.go_to(0.0, 0.0, 2.0), bench.run(1.2)),
    "stop": lambda bench: bench.run(0.7),
    "e-stop": lambda bench: (bench.estop(True), bench.run(0.4), bench.estop(False)),
}
MOST_DATAGRAMS: Final = 7
"""Largest number of datagrams that the search disturbs per user command, in each direction.

Each is disturbed in a trial of its own. Regular queries and their replies are not counted.
"""
PROOF_S: Final = 0.25
"""Longest time in s after the failure of the IMU in which the driver may still start a motion.

The driver's check of the IMU must prevent a later start.
"""
STARTS: Final = (b"RM", b"B", b"R", b"L", b"TF", b"TB")
"""Commands with which the server starts the motors without checking the IMU."""
MET: Final = (b"", b"RM 30", b"B SLOW", b"L SLOW", b"TF 300", b"MCR 350")
"""The motions that may be in progress on the server when the driver starts, as commands. Each trial
uses one of them; an empty command means no motion."""
AWAY_S: Final = tuple(n / 5 for n in range(0, 41))
"""Durations in s of the network's first interruption, which begins when the driver starts."""
BACK_S: Final = (0.2, 0.7, 30.0)
"""Times in s from the end of the network's first interruption to the second, which lasts 1 s.

With 30 s, the trial ends before the second interruption.
"""
ENDS_S, SETTLED_S = 16.0, 1.5


class Trial(NamedTuple):
    """One run of the search, of one of two kinds.

    * With user commands (``wishes``): one datagram is disturbed.
    * Without user commands: the driver starts while the server executes a command (``met``), and
      the network is interrupted.

    Attributes:

    * ``wishes``: names of the user commands, from ``WISHES``.
    * ``way``: direction of the disturbed datagram: 0 to the server, 1 from the server.
    * ``number``: the disturbed datagram's number in that direction, from 0. Regular queries and
      their replies are not counted.
    * ``fate``: what happens to this datagram.
    * ``met``: command that the server is executing when the driver starts; empty for none.
    * ``away_s``: duration in s of the first interruption, which begins when the driver starts.
    * ``back_s``: time in s from the end of the first interruption to a second one, which lasts 1 s.
    * ``ways``: the directions that are interrupted.
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
    """A network that delivers all datagrams, apart from the faults that the trial prescribes."""

    def __init__(self, bench: MartBench, trial: Trial) -> None:
        self.bench, self.robot, self.trial = bench, bench.robot, trial
        self.board = bench.robot.board
        self.numbers = [-1, -1]
        self.counting = False
        self.died_s = math.inf
        self._late: list[tuple[float, int, int, Packet]] = []
        self._carried = 0

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
            fates = {"lost": [], "late": [late_s], "twice": [now_s, late_s]}
            times_s = fates.get(self.trial.fate, times_s)
            if self.trial.fate == "the IMU dies":
                self.board.server.imu.alive = False
                self.died_s = now_s
        for at_s in times_s:
            heapq.heappush(self._late, (at_s, self._carried, way, packet))
            self._carried += 1

    @property
    def _is_polled(self) -> bool:
        """Whether the driver waits for the reply to a regular query."""
        pending = self.bench.board._pilot.conversation.pending
        return pending is not None and pending.word.kind is words.Kind.QUERY

    def receive(self, data: bytes, now: float, channel: int) -> None:
        self._put(0, (channel, data), data in POLLS)

    def advance(self) -> list[Packet]:
        out: list[Packet] = []
        if not self._late and sleeps(self.board):
            return out
        for _ in range(5):
            for channel, data in self.board.advance():
                self._put(1, (channel, data), self._is_polled)
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
    """Yield trials of all pairs of user commands in ``WISHES``, with one fault in each trial."""
    for pair in product(WISHES, WISHES):
        yield from each_fate(pair)


def eights() -> Iterator[Trial]:
    """Yield trials of some sequences of eight user commands, with one fault in each trial.

    The commands are in ``WISHES``.
    """
    names = tuple(WISHES)
    for step in range(len(names)):
        yield from each_fate(tuple(names[n * step % len(names)] for n in range(8)))


def each_fate(wishes: tuple[str, ...]) -> Iterator[Trial]:
    """Yield trials of one sequence of user commands, each with one disturbed datagram.

    There is one trial for each fault in ``FATES`` and each of the first datagrams in each
    direction: at most ``MOST_DATAGRAMS`` datagrams for each user command.
    """
    for way, number in enumerate(ran(Trial(wishes)).numbers):
        most = min(number + 1, MOST_DATAGRAMS * len(wishes))
        for n, fate in product(range(most), FATES):
            yield Trial(wishes, way, n, fate)


def beginnings() -> Iterator[Trial]:
    """Yield the trials in which a driver starts while the server may be executing a command.

    There is one trial for each motion in ``MET`` with each interruption of the network.
    """
    for met, away_s, back_s in product(MET, AWAY_S, BACK_S):
        for ways in ((0, 1), (0,), (1,)):
            yield Trial(met=met, away_s=away_s, back_s=back_s, ways=ways)


@cache
def _ready() -> MartBench:
    return MartBench("firmware", seed=3).ready()


def ran(trial: Trial) -> Carrier:
    """Run the trial to its end, and return its network.

    The caller can read the final state of robot, server and driver from the network.
    """
    # The driver compares its words by identity, so the copy has the same words.
    same = {id(word): word for word in vars(words).values() if isinstance(word, words.Word)}
    bench = copy.deepcopy(_ready(), same) if trial.wishes else MartBench("firmware", seed=3)
    carrier = bench.robot = Carrier(bench, trial)
    if trial.wishes:
        carrier.counting = True
        for wish in trial.wishes:
            WISHES[wish](bench)
        bench.run(0.5)
        carrier.counting = False
        bench.run(1.5)
        bench.estop(True)  # a goal continues without further commands
        bench.run(3.0)
        return carrier
    if trial.met:
        bench.server.receive(trial.met, 0, None, 0.0)
    bench.open()
    bench.run(trial.away_s + (trial.back_s + 1.0 if trial.back_s < ENDS_S else 0.0))
    rests_s = 0.0
    for _ in range(round(ENDS_S / 0.1)):
        bench.run(0.1)
        rests = bench.robot.stands and bench.session.state == "nominal"
        rests_s = rests_s + 0.1 if rests else 0.0
        if rests_s > SETTLED_S:
            break
    return carrier


def trouble(trial: Trial) -> str:
    """Run the trial, and return what went wrong in it, or an empty text."""
    carrier = ran(trial)
    bench, server = carrier.bench, carrier.bench.server
    lost = bench.board._pilot.lost > 0
    if math.isfinite(carrier.died_s):
        late_s = carrier.died_s + PROOF_S
        if any(at_s > late_s and data.split()[0] in STARTS for at_s, _, data in server.received):
            return "a motion begins with a dead IMU"
        return "" if carrier.stands or lost else "the robot moves, and the driver does not say so"
    if server.hung or server.crashed or (trial.wishes and server.stop_port_hung):
        return "the server hangs"
    if not carrier.stands:
        return "the robot moves"
    return "the driver regards the server as lost" if trial.wishes and lost else ""


SETS: Final[dict[str, Callable[[], Iterator[Trial]]]] = {
    "pairs": pairs,
    "eights": eights,
    "beginnings": beginnings,
}


def search(trials: list[Trial]) -> list[tuple[Trial, str]]:
    """Return the trials that end badly, each with the reason."""
    with Pool(os.cpu_count()) as pool:
        found = pool.map(trouble, trials, chunksize=8)
    return [(trial, why) for trial, why in zip(trials, found, strict=True) if why]


def main() -> None:
    """Run all sets of trials, or only the sets that the command line names.

    * ``pairs``: sequences of two user commands.
    * ``eights``: sequences of eight user commands.
    * ``beginnings``: a driver starts while the server may be executing a command.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sets", nargs="*", choices=tuple(SETS), help="default: all sets")
    for name in parser.parse_args().sets or SETS:
        began_s = time.monotonic()
        trials = list(SETS[name]())
        bad = search(trials)
        took_s = time.monotonic() - began_s
        print(f"{name}: {len(trials)} trials in {took_s:.0f} s, {len(bad)} end badly", flush=True)
        for trial, why in bad[:20]:
            print(f"  {why}: {trial}")


if __name__ == "__main__":
    main()
