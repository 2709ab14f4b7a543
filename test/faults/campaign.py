# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The fault campaign: ``make faults`` runs it and writes its table into docs/safety.md.

Every scripted fault, random input, random walks over several seeds; with ``--minutes`` a soak of
random walks alone. Ends with 1 when anything went wrong.
"""

import argparse
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
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
from stuck import NETWORK
from walk import walk

DOCUMENT: Final = Path(__file__).parents[2] / "docs" / "safety.md"
BEGIN, END = "<!-- campaign: begin -->", "<!-- campaign: end -->"
ROUNDS: Final = 2
WALKS, GOAL_WALKS, STEPS = 4, 2, 30
FUZZ: Final = 10_000
LOSSES: Final = 30
"""Of each stop on a line that loses bytes towards the board."""
SOAK_STEPS: Final = 30


@dataclass(slots=True)
class Row:
    """One line of the table."""

    name: str
    tried: int = 0
    stood_s: float = 0.0
    complaints: int = 0

    def __str__(self) -> str:
        verdict = f"**{self.complaints} complaints**" if self.complaints else "survived"
        return f"| {self.name} | {self.tried} | {self.stood_s:.2f} s | {verdict} |"


class Campaign:
    """Rows of the table, and everything anybody complained of."""

    def __init__(self) -> None:
        self.rows: list[Row] = []
        self.complaints: list[str] = []
        self.published = self.wrong = 0
        self._folder = tempfile.TemporaryDirectory()

    def rig(self, kind: type[Rig] = Rig, before: str = "") -> Rig:
        return kind(Path(tempfile.mkdtemp(dir=self._folder.name)), before=before)

    def run(self, row: Row, case: Case[Any], rig: Rig, *, again: bool = True) -> None:
        """One try."""
        try:
            case(rig)
            row.stood_s = max([row.stood_s, *rig.findings.stood_after_s])
            if again:
                rig.expect_obeys_again()
        except Exception as error:  # whatever it is, the others are tried all the same
            rig.findings.expect(False, f"{row.name}: {error!r}")
        row.tried += 1
        rig.findings.stood_after_s.clear()
        complaints = [f"{row.name}: {complaint}" for complaint in rig.findings.take()]
        row.complaints += len(complaints)
        self.complaints += complaints
        print(row, *complaints, sep="\n  ", flush=True)
        if complaints:
            print("the log ends:", *rig.driver.lines[-20:], sep="\n    ", flush=True)

    def judge(self, rig: Rig, *, damaged_bytes: bool = True) -> None:
        """What one rig published."""
        rig.judge_stream(damaged_bytes)
        self.published += rig.findings.published
        self.wrong += rig.findings.wrong
        self.complaints += rig.findings.take()

    def row(self, name: str) -> Row:
        self.rows.append(Row(name))
        return self.rows[-1]

    def scripted(self) -> None:
        """Each fault in each round, in one driver's life; then those that end a driver."""
        self._one_life(Rig, survivable, damaged_bytes=True)
        self._one_life(NetworkRig, lambda _: NETWORK, damaged_bytes=False)
        self._one_life(GoalRig, lambda _: GOALS, damaged_bytes=False)
        for name, ending in ENDINGS.items():
            self._ends(f"the driver ends: {name}", ending, before=ending.before)
        for name, case in GOAL_ENDINGS.items():
            self._ends(name, case, kind=GoalRig)
        row = self.row("the driver ends: its terminal is closed")
        for _ in range(ROUNDS):
            terminal_is_closed(
                lambda before: self.rig(before=before),
                lambda rig, end, row=row: self.run(row, end, rig, again=False),
            )

    def _one_life(
        self, kind: type[Rig], cases: Callable[[int], dict[str, Case[Any]]], *, damaged_bytes: bool
    ) -> None:
        rows = {name: self.row(name) for name in cases(0)}
        with self.rig(kind) as rig:
            self.run(Row("warm-up"), lambda rig: rig.wait_ticks(100), rig)
            descriptors, memory = rig.cost()
            for number in range(ROUNDS):
                for name, case in cases(number).items():
                    self.run(rows[name], case, rig)
            self.judge(rig, damaged_bytes=damaged_bytes)
            self._compare_cost(rig, descriptors, memory)

    def _ends(self, name: str, case: Case[Any], kind: type[Rig] = Rig, before: str = "") -> None:
        row = self.row(name)
        for _ in range(ROUNDS):
            with self.rig(kind, before) as rig:
                self.run(row, case, rig, again=False)

    def losses(self) -> None:
        """Each stop with losses towards the board that last until the verdict."""
        for life in LIVES:
            rows = {
                name: self.row(f"1 or 5 bytes in 100 lost to the board: {name}") for name in life
            }
            for number in range(LOSSES):
                with losing_rig(Path(tempfile.mkdtemp(dir=self._folder.name)), number) as rig:
                    lose(rig, number)
                    for name, case in life.items():
                        self.run(rows[name], case, rig, again=False)

    def busy_computer(self) -> None:
        """Nothing is wrong with the line."""
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

    def walks(self, name: str, kind: type[Rig], seeds: range) -> None:
        row = self.row(name)
        for seed in seeds:
            with self.rig(kind) as rig:
                self.run(row, partial(_walk, seed, STEPS), rig)
                self.judge(rig)

    def soak(self, minutes: float) -> None:
        """Random walks in one driver's life."""
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

    def table(self) -> str:
        """In Markdown."""
        lines = ["| fault | tried | robot stood after at most | |", "|---|---|---|---|"]
        lines += [str(row) for row in self.rows]
        lines += [
            "",
            f"{self.published:,} messages of `imu/data_raw` and `odom` were compared with what the "
            f"board had sent: {self.wrong} were wrong.",
        ]
        return "\n".join(lines)


def _walk(seed: int, steps: int, rig: Rig) -> None:
    names = Counter(walk(rig, Random(seed), steps))
    print(f"  walk {seed}: " + ", ".join(f"{count} {name}" for name, count in names.items()))


def main() -> int:
    """Run, print, write."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument(
        "--board", choices=("omnibot",), default="omnibot", help="that this is measured on"
    )
    arguments.add_argument("--minutes", type=float, help="a soak of random walks only")
    arguments.add_argument("--losses", action="store_true", help="stops on a lossy line only")
    arguments.add_argument("--busy", action="store_true", help="a busy computer only")
    chosen = arguments.parse_args()
    minutes = chosen.minutes
    os.environ["ROS_DOMAIN_ID"] = str(1 + os.getpid() % 101)
    rclpy.init()
    campaign = Campaign()
    if minutes is not None:
        campaign.soak(minutes)
    elif chosen.losses:
        campaign.losses()
    elif chosen.busy:
        campaign.busy_computer()
    else:
        campaign.scripted()
        campaign.losses()
        campaign.busy_computer()
        campaign.random_input()
        campaign.walks(f"random walks of {STEPS} faults", Rig, range(WALKS))
        campaign.walks(f"with goals: random walks of {STEPS} faults", GoalRig, range(GOAL_WALKS))
    rclpy.shutdown()
    table = campaign.table()
    print(f"\n{table}\n", *campaign.complaints, sep="\n")
    if minutes is None and not (chosen.losses or chosen.busy):
        before, rest = DOCUMENT.read_text().split(BEGIN)
        DOCUMENT.write_text(f"{before}{BEGIN}\n{table}\n{END}{rest.split(END)[1]}")
    return 1 if campaign.complaints else 0


if __name__ == "__main__":
    sys.exit(main())
