"""The timing report: prints the worst figures of each cell and writes them into docs/time.md.

Arguments: ``--seconds`` of each stream and ``--seeds``. The seeds share out the skews.
"""

import argparse
import os
import sys
from functools import partial
from multiprocessing import Pool
from pathlib import Path

from stamping import LINES, spread, stamp

DOCUMENT = Path(__file__).parents[2] / "docs" / "time.md"
BEGIN, END = "<!-- figures: begin -->", "<!-- figures: end -->"

SKEWS = (-1e-4, -5e-5, 0.0, 5e-5, 1e-4)
LOSSES = (0.0, 1e-3, 1e-2)
SCENARIOS = {"nominal": "driving", "IMU only": "IMU only, noisy gyro"}
SETTLED_S = {"4096-byte blocks": 6.0}
"""Two blocks; all else is settled after two seconds."""

Cell = tuple[str, float, str]
Figures = tuple[float, float]
"""Unevenness, and the half-width that holds 99 % of the errors; seconds."""


def one(seconds: float, job: tuple[Cell, int]) -> tuple[Cell, Figures]:
    """One stream, in a process of the pool."""
    (line, loss, mode), seed = job
    skew = SKEWS[seed % len(SKEWS)]
    stamped = stamp(line, SCENARIOS[mode], loss, skew, seed, seconds)
    since_s = SETTLED_S.get(line, 2.0)
    return job[0], (stamped.unevenness(since_s), spread(stamped.errors(since_s)))


def main() -> None:
    """Run, print, write."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--seconds", type=float, default=30.0)
    arguments.add_argument("--seeds", type=int, default=30)
    chosen = arguments.parse_args()
    cells = [(line, loss, mode) for line in LINES for loss in LOSSES for mode in SCENARIOS]
    jobs = [(cell, seed) for cell in cells for seed in range(chosen.seeds)]
    found: dict[Cell, list[Figures]] = {cell: [] for cell in cells}
    with Pool(os.cpu_count()) as pool:
        for cell, figures in pool.imap_unordered(partial(one, chosen.seconds), jobs, chunksize=4):
            found[cell].append(figures)
            done = sum(map(len, found.values()))
            print(f"\r{done} of {len(jobs)} streams", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    lines = [
        f"{chosen.seeds} streams of {chosen.seconds:g} s in each cell; the worst, and the median:",
        "",
        "| line | bytes lost | mode | steps, std (ms) | 99 % within (ms) |",
        "|---|---|---|---|---|",
    ]
    for cell, figures in found.items():
        shown = []
        for values, limit_s in zip(zip(*figures, strict=True), (0.2e-3, 0.5e-3), strict=True):
            worst, median = max(values), sorted(values)[len(values) // 2]
            mark = " **above**" if worst > limit_s else ""
            shown.append(f"{worst * 1e3:.3f} ({median * 1e3:.3f}){mark}")
        line, loss, mode = cell
        lines.append(f"| {line} | {loss:g} | {mode} | {shown[0]} | {shown[1]} |")
    text = "\n".join(lines)
    print(text)
    before, rest = DOCUMENT.read_text().split(BEGIN)
    DOCUMENT.write_text(f"{before}{BEGIN}\n{text}\n{END}{rest.split(END)[1]}")


if __name__ == "__main__":
    main()
