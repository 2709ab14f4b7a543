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
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from random import Random
from typing import Final

import rclpy
from cases import COMMANDS, ENDINGS, HOST, LINE, SERVICES, Case, random_lines
from fuzz import fuzz
from rig import Rig
from walk import walk

DOCUMENT: Final = Path(__file__).parents[2] / "docs" / "safety.md"
BEGIN, END = "<!-- campaign: begin -->", "<!-- campaign: end -->"
ROUNDS: Final = 3
WALKS, STEPS = 5, 30
FUZZ: Final = 10_000
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

    def rig(self) -> Rig:
        return Rig(Path(tempfile.mkdtemp(dir=self._folder.name)))

    def run(self, row: Row, case: Case, rig: Rig, *, again: bool = True) -> None:
        """One try."""
        try:
            case(rig)
            if again:
                rig.expect_obeys_again()
        except AssertionError as error:
            rig.findings.expect(False, f"{row.name}: {error}")
        row.tried += 1
        row.stood_s = max([row.stood_s, *rig.findings.stood_after_s])
        rig.findings.stood_after_s.clear()
        complaints = [f"{row.name}: {complaint}" for complaint in rig.findings.take()]
        row.complaints += len(complaints)
        self.complaints += complaints
        print(row, *complaints, sep="\n  ", flush=True)

    def judge(self, rig: Rig) -> None:
        """What one rig published."""
        rig.judge_stream(damaged_bytes=True)
        self.published += rig.findings.published
        self.wrong += rig.findings.wrong
        self.complaints += rig.findings.take()

    def row(self, name: str) -> Row:
        self.rows.append(Row(name))
        return self.rows[-1]

    def scripted(self) -> None:
        """Each fault in each round, in one driver's life; then those that end a driver."""
        rows = {name: self.row(name) for name in {**COMMANDS, **LINE, **random_lines(0)}}
        rows |= {name: self.row(name) for name in {**SERVICES, **HOST}}
        with self.rig() as rig:
            self.run(Row("warm-up"), lambda _: None, rig)
            descriptors, memory = rig.cost()
            for number in range(ROUNDS):
                cases = {**COMMANDS, **LINE, **random_lines(number), **SERVICES, **HOST}
                for name, case in cases.items():
                    self.run(rows[name], case, rig)
            self.judge(rig)
            self._compare_cost(rig, descriptors, memory)
        for name, case in ENDINGS.items():
            row = self.row(f"the driver ends: {name}")
            for _ in range(ROUNDS):
                with self.rig() as rig:
                    self.run(row, case, rig, again=False)

    def random_input(self) -> None:
        row = self.row(f"{FUZZ:,} random messages and calls")
        with self.rig() as rig:
            self.run(row, lambda rig: fuzz(rig, FUZZ, Random(1)), rig)
            self.judge(rig)

    def walks(self, seeds: range) -> None:
        row = self.row(f"random walks of {STEPS} faults")
        for seed in seeds:
            with self.rig() as rig:
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
    arguments.add_argument("--minutes", type=float, help="a soak of random walks only")
    minutes = arguments.parse_args().minutes
    os.environ["ROS_DOMAIN_ID"] = str(1 + os.getpid() % 101)
    rclpy.init()
    campaign = Campaign()
    if minutes is not None:
        campaign.soak(minutes)
    else:
        campaign.scripted()
        campaign.random_input()
        campaign.walks(range(WALKS))
    rclpy.shutdown()
    table = campaign.table()
    print(f"\n{table}\n", *campaign.complaints, sep="\n")
    if minutes is None:
        before, rest = DOCUMENT.read_text().split(BEGIN)
        DOCUMENT.write_text(f"{before}{BEGIN}\n{table}\n{END}{rest.split(END)[1]}")
    return 1 if campaign.complaints else 0


if __name__ == "__main__":
    sys.exit(main())
