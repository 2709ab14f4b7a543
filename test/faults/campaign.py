# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The fault campaign: ``make faults`` runs it and writes its table into docs/internals/faults.md.

With ``--minutes`` the campaign has only random faults. The exit code is 1 when anything was wrong.
"""

import argparse
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from random import Random
from typing import Any, Final

import rclpy
from busy_computer import LOOPS, PIECE, TICKS, PiecesRig, is_busy
from cases import Case, survivable
from endings import ENDINGS, terminal_is_closed
from fuzz import fuzz
from goals import GOAL_ENDINGS, GOALS
from losses import LIVES, lose, losing_rig
from other_rigs import GoalRig, NetworkRig
from rig import Rig
from rig_board import RigBoard, load
from stuck import NETWORK
from walk import walk

DOCUMENT: Final = Path(__file__).parents[2] / "docs" / "internals" / "faults.md"
BEGIN, END = "<!-- campaign: begin -->", "<!-- campaign: end -->"
BOARDS: Final = ("omnibot", "lois_ecu", "mart", "fejemis")
ROUNDS: Final = 2
WALKS, GOAL_WALKS, STEPS = 4, 2, 30
FUZZ: Final = 10_000
LOSSES: Final = 30
"""Number of drivers on a lossy line for each pair of stops in ``LIVES``.

Each driver performs both stops of a pair, for example a timeout and ctrl-C.
"""
LOSSES_AT_ONCE: Final = 10
SOAK_STEPS: Final = 30
BUSY: Final = ("busy_computer", ())


@dataclass(slots=True)
class Row:
    """One row of the campaign's table: the result of all runs of one fault."""

    name: str
    tried: int = 0
    stood_s: float = 0.0
    complaints: int = 0

    def __str__(self) -> str:
        verdict = f"**{self.complaints} complaints**" if self.complaints else "survived"
        return f"| {self.name} | {self.tried} | {self.stood_s:.2f} s | {verdict} |"


@dataclass(slots=True)
class Outcome:
    """Result of some pieces (independent parts) of the campaign.

    ``published``: number of messages that were compared with what the board sent.

    ``wrong``: number of wrong messages among them.
    """

    rows: list[Row] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)
    published: int = 0
    wrong: int = 0

    def add(self, more: "Outcome") -> None:
        """Add the rows, complaints and numbers of another outcome to this outcome.

        Rows with the same name are combined into one row.
        """
        mine = {row.name: row for row in self.rows}
        for row in more.rows:
            if (same := mine.get(row.name)) is None:
                self.rows.append(row)
                continue
            same.tried += row.tried
            same.stood_s = max(same.stood_s, row.stood_s)
            same.complaints += row.complaints
        self.complaints += more.complaints
        self.published += more.published
        self.wrong += more.wrong

    def table(self) -> str:
        """Return the table in Markdown."""
        lines = ["| fault | tried | robot stood after at most | |", "|---|---|---|---|"]
        lines += [str(row) for row in self.rows]
        lines += [
            "",
            f"{self.published:,} messages of `imu/data_raw` and `odom` were compared with what the "
            f"board had sent: {self.wrong} were wrong.",
        ]
        return "\n".join(lines)


class Campaign(Outcome):
    """Runs one piece of the campaign in this process and collects its result."""

    def __init__(self, kind: RigBoard) -> None:
        super().__init__()
        self._kind = kind
        self._folder = tempfile.TemporaryDirectory()

    @property
    def outcome(self) -> Outcome:
        """The result as an ``Outcome``, which can be sent to another process."""
        return Outcome(self.rows, self.complaints, self.published, self.wrong)

    def rig(self, kind: type[Rig] = Rig, before: str = "") -> Rig:
        return kind(Path(tempfile.mkdtemp(dir=self._folder.name)), self._kind, before=before)

    def run(self, row: Row, case: Case[Any], rig: Rig, *, again: bool = True) -> None:
        """Run a case once. Add its result to ``row``, and collect what went wrong.

        ``again``: whether the robot must obey a new command after the case.
        """
        try:
            case(rig)
            row.stood_s = max([row.stood_s, *rig.findings.stood_after_s])
            if again:
                rig.expect_obeys_again()
        except Exception as error:  # the other cases run after any error
            rig.findings.expect(False, repr(error))
            rig.line.heal()  # the next case needs an undamaged line
        row.tried += 1
        rig.findings.stood_after_s.clear()
        complaints = [f"{row.name}: {complaint}" for complaint in rig.findings.take()]
        row.complaints += len(complaints)
        self.complaints += complaints
        print(row, *complaints, sep="\n  ", flush=True)
        if complaints:
            print("the log ends:", *rig.driver.lines[-20:], sep="\n    ", flush=True)

    def judge(self, rig: Rig, *, damaged_bytes: bool = True) -> None:
        """Compare the messages from a rig's driver with the frames that the rig's board sent."""
        rig.judge_stream(damaged_bytes)
        self.published += rig.findings.published
        self.wrong += rig.findings.wrong
        self.complaints += rig.findings.take()

    def row(self, name: str) -> Row:
        self.rows.append(Row(name))
        return self.rows[-1]

    def faults_of_the_line(self) -> None:
        """Run all faults of the line in each of the rounds, all with the same driver."""
        self._one_life(Rig, self._kind.cases or survivable, damaged_bytes=True)

    def faults_of_the_network(self) -> None:
        self._one_life(NetworkRig, lambda _: NETWORK, damaged_bytes=False)

    def faults_of_goals(self) -> None:
        self._one_life(GoalRig, lambda _: GOALS, damaged_bytes=False)

    def ending(self, name: str) -> None:
        """Make a driver end in the given way, and check the result.

        Repeat this in every round, with a new driver each time.
        """
        ending = ENDINGS[name]
        self._ends(f"the driver ends: {name}", ending, before=ending.before)

    def goal_ending(self, name: str) -> None:
        self._ends(name, GOAL_ENDINGS[name], kind=GoalRig)

    def closed_terminal(self) -> None:
        row = self.row("the driver ends: its terminal is closed")
        for _ in range(ROUNDS):
            terminal_is_closed(
                lambda before: self.rig(before=before),
                lambda rig, end, row=row: self.run(row, end, rig, again=False),
            )

    def _one_life(
        self,
        kind: type[Rig],
        cases: Callable[[int], Mapping[str, Case[Any]]],
        *,
        damaged_bytes: bool,
    ) -> None:
        rows = {name: self.row(name) for name in cases(0) if name not in self._kind.without}
        with self.rig(kind) as rig:
            self.run(Row("warm-up"), lambda rig: rig.wait_ticks(100), rig)
            descriptors, memory = rig.cost()
            for number in range(ROUNDS):
                for name, case in cases(number).items():
                    if name in rows:
                        self.run(rows[name], case, rig)
            self.judge(rig, damaged_bytes=damaged_bytes)
            self._compare_cost(rig, descriptors, memory)

    def _ends(self, name: str, case: Case[Any], kind: type[Rig] = Rig, before: str = "") -> None:
        row = self.row(name)
        for _ in range(ROUNDS):
            with self.rig(kind, before) as rig:
                self.run(row, case, rig, again=False)

    def losses(self, number_of_life: int, numbers: range) -> None:
        """Test how the robot stops if the line loses bytes on the way to the board.

        For each seed in ``numbers``, a new driver performs all stops of one group.

        ``number_of_life``: index of the group in ``LIVES``.

        ``numbers``: seeds for the board's settings and the losses.
        """
        life = LIVES[number_of_life]
        rows = {name: self.row(f"1 or 5 bytes in 100 lost to the board: {name}") for name in life}
        for number in numbers:
            folder = Path(tempfile.mkdtemp(dir=self._folder.name))
            with losing_rig(folder, self._kind, number) as rig:
                lose(rig, number)
                for name, case in life.items():
                    self.run(rows[name], case, rig, again=False)

    def busy_computer(self) -> None:
        """Test ``ROUNDS`` drives on a busy computer, with an undamaged line."""
        row = self.row(
            f"{LOOPS} busy loops for {TICKS // 100} s, the line in pieces of {PIECE} bytes"
        )
        for _ in range(ROUNDS):
            with self.rig(PiecesRig) as rig:
                assert isinstance(rig, PiecesRig)
                self.run(row, is_busy, rig)
                self.judge(rig, damaged_bytes=False)

    def random_input(self) -> None:
        row = self.row(f"{FUZZ:,} random messages and calls, 1,000 a second")
        with self.rig() as rig:
            self.run(row, lambda rig: fuzz(rig, FUZZ, Random(1)), rig)
            self.judge(rig)

    def walk(self, seed: int) -> None:
        self._walk(f"random walks of {STEPS} faults", Rig, seed)

    def walk_with_goals(self, seed: int) -> None:
        self._walk(f"with goals: random walks of {STEPS} faults", GoalRig, seed)

    def _walk(self, name: str, kind: type[Rig], seed: int) -> None:
        with self.rig(kind) as rig:
            self.run(self.row(name), partial(_walk, seed, STEPS), rig)
            self.judge(rig)

    def soak(self, minutes: float) -> None:
        """Run sequences of random faults with one driver for ``minutes``."""
        row = self.row(f"soak: random walks of {SOAK_STEPS} faults")
        end, seed = time.monotonic() + 60 * minutes, 0
        with self.rig() as rig:
            self.run(row, partial(_walk, 0, SOAK_STEPS), rig)
            descriptors, memory = rig.cost()
            while time.monotonic() < end:
                seed += 1
                self.run(row, partial(_walk, seed, SOAK_STEPS), rig)
            self.judge(rig)
            self._compare_cost(rig, descriptors, memory)

    def _compare_cost(self, rig: Rig, descriptors: int, memory_kb: int) -> None:
        now, now_kb = rig.cost()
        print(f"descriptors {descriptors} -> {now}, memory {memory_kb} -> {now_kb} kB")
        if now > descriptors:
            self.complaints.append(f"descriptors grew from {descriptors} to {now}")
        if now_kb > memory_kb * 1.1:
            self.complaints.append(f"memory grew from {memory_kb} to {now_kb} kB")


Piece = tuple[str, tuple[Any, ...]]
"""The name of a method of ``Campaign``, and its arguments."""


def losses() -> list[Piece]:
    """Return the pieces of the campaign that lose bytes on the line from the driver to the board.

    Each piece runs ten drivers, one after the other.
    """
    starts = range(0, LOSSES, LOSSES_AT_ONCE)
    return [
        ("losses", (life, range(start, start + LOSSES_AT_ONCE)))
        for life in range(len(LIVES))
        for start in starts
    ]


def pieces() -> list[Piece]:
    """Return all pieces of the campaign in the order of the table, except ``busy_computer``.

    That piece must run alone.
    """
    return [
        ("faults_of_the_line", ()),
        ("faults_of_the_network", ()),
        ("faults_of_goals", ()),
        *(("ending", (name,)) for name in ENDINGS),
        *(("goal_ending", (name,)) for name in GOAL_ENDINGS),
        ("closed_terminal", ()),
        *losses(),
        ("random_input", ()),
        *(("walk", (seed,)) for seed in range(WALKS)),
        *(("walk_with_goals", (seed,)) for seed in range(GOAL_WALKS)),
    ]


def play(board: str, numbered: tuple[int, Piece]) -> Outcome:
    """Run one piece of the campaign in its own process and ROS domain; return the result."""
    number, (method, arguments) = numbered
    os.environ["ROS_DOMAIN_ID"] = str(1 + (os.getppid() + number) % 101)
    rclpy.init()
    try:
        campaign = Campaign(load(board))
        getattr(campaign, method)(*arguments)
        return campaign.outcome
    finally:
        rclpy.shutdown()


def side_by_side(board: str, wanted: list[Piece], processes: int) -> Outcome:
    """Run those pieces of the campaign in ``wanted`` that apply to the board, in parallel.

    Return their results as one ``Outcome``, with rows in the order of ``wanted``.
    """
    total, without = Outcome(), load(board).without
    wanted = [piece for piece in wanted if without.isdisjoint((piece[0], *map(str, piece[1])))]
    with get_context("spawn").Pool(processes, maxtasksperchild=1) as pool:
        for outcome in pool.imap(partial(play, board), enumerate(wanted), chunksize=1):
            total.add(outcome)
    return total


def _walk(seed: int, steps: int, rig: Rig) -> None:
    names = Counter(walk(rig, Random(seed), steps))
    print(f"  walk {seed}: " + ", ".join(f"{count} {name}" for name, count in names.items()))


def main() -> int:
    """Run the campaign, print its table and write it. Return the exit code."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument(
        "--board", choices=BOARDS, default="omnibot", help="board to measure (default %(default)s)"
    )
    arguments.add_argument("--minutes", type=float, help="a soak of random walks only")
    arguments.add_argument("--losses", action="store_true", help="stops on a lossy line only")
    arguments.add_argument("--busy", action="store_true", help="a busy computer only")
    arguments.add_argument(
        "--processes",
        type=int,
        default=os.cpu_count(),
        help="number of processes at the same time (default %(default)s)",
    )
    chosen = arguments.parse_args()
    board, minutes = chosen.board, chosen.minutes
    if minutes is not None:
        total = side_by_side(board, [("soak", (minutes,))], 1)
    elif chosen.losses:
        total = side_by_side(board, losses(), chosen.processes)
    elif chosen.busy:
        total = side_by_side(board, [BUSY], 1)
    else:
        total = side_by_side(board, pieces(), chosen.processes)
        total.add(side_by_side(board, [BUSY], 1))
    table = total.table()
    print(f"\n{table}\n", *total.complaints, sep="\n")
    if minutes is None and not (chosen.losses or chosen.busy):
        begin = BEGIN if board == "omnibot" else f"<!-- campaign of {board}: begin -->"
        before, rest = DOCUMENT.read_text().split(begin)
        DOCUMENT.write_text(f"{before}{begin}\n{table}\n{END}{rest.split(END, 1)[1]}")
    return 1 if total.complaints else 0


if __name__ == "__main__":
    sys.exit(main())
