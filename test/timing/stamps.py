# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The timing report: prints the worst figures of each cell and writes them into docs/time.md.

Arguments: ``--seconds`` of each stream and ``--seeds``. The seeds share out the skews.
"""

import argparse
import os
import sys
from functools import partial
from multiprocessing import Pool
from pathlib import Path

from stamping import EVENTS_S, LINES, SETTLED_S, spread, stamp

DOCUMENT = Path(__file__).parents[2] / "docs" / "time.md"
BEGIN, END = "<!-- figures: begin -->", "<!-- figures: end -->"

SKEWS = (-1e-4, -5e-5, 0.0, 5e-5, 1e-4)
LOSSES = (0.0, 1e-3, 1e-2)
SCENARIOS = {"nominal": "driving", "IMU only": "IMU only, noisy gyro"}
BLOCKS = "4096-byte blocks"
BLOCKS_SETTLED_S = 6.0
"""Two blocks."""
LIMITS_S = (0.2e-3, 0.5e-3)

Cell = tuple[str, float, str, str]
"""Line, part of the bytes that are lost, mode, event."""
Figures = tuple[float, float]
"""Unevenness, and the half-width that holds 99 % of the errors; seconds."""


def one(seconds: float, job: tuple[Cell, int]) -> tuple[Cell, Figures]:
    """One stream, in a process of the pool."""
    (line, loss, mode, event), seed = job
    skew = SKEWS[seed % len(SKEWS)]
    stamped = stamp(line, SCENARIOS[mode], loss, skew, seed, seconds, event)
    since_s = BLOCKS_SETTLED_S if line == BLOCKS else SETTLED_S
    return job[0], (stamped.unevenness(since_s), spread(stamped.errors(since_s)))


def table(head: str, rows: dict[str, list[Figures]]) -> list[str]:
    """The worst and the median of each row, and how many streams keep both limits."""
    lines = [
        f"| {head} | steps, std (ms) | 99 % within (ms) | streams that keep both limits |",
        "|---" * (head.count("|") + 4) + "|",
    ]
    for name, figures in rows.items():
        shown = []
        for values in zip(*figures, strict=True):
            worst, median = max(values), sorted(values)[len(values) // 2]
            shown.append(f"{worst * 1e3:.3f} ({median * 1e3:.3f})")
        kept = sum(all(map(float.__le__, pair, LIMITS_S)) for pair in figures)
        lines.append(f"| {name} | {shown[0]} | {shown[1]} | {kept} of {len(figures)} |")
    return lines


def main() -> None:
    """Run, print, write."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--seconds", type=float, default=30.0)
    arguments.add_argument("--seeds", type=int, default=30)
    chosen = arguments.parse_args()
    undisturbed, *events = EVENTS_S
    cells = [(line, n, mode, undisturbed) for line in LINES for n in LOSSES for mode in SCENARIOS]
    cells += [
        (line, 1e-3, mode, event)
        for event in events
        for line in LINES
        if line != BLOCKS
        for mode in SCENARIOS
    ]
    jobs = [(cell, seed) for cell in cells for seed in range(chosen.seeds)]
    found: dict[Cell, list[Figures]] = {cell: [] for cell in cells}
    with Pool(os.cpu_count()) as pool:
        for cell, figures in pool.imap_unordered(partial(one, chosen.seconds), jobs, chunksize=4):
            found[cell].append(figures)
            done = sum(map(len, found.values()))
            print(f"\r{done} of {len(jobs)} streams", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    plain = {
        f"{line} | {loss:g} | {mode}": figures
        for (line, loss, mode, event), figures in found.items()
        if event == undisturbed
    }
    disturbed = {
        f"{event} | {line} | {mode}": figures
        for (line, _, mode, event), figures in found.items()
        if event != undisturbed
    }
    lines = [
        f"{chosen.seeds} streams of {chosen.seconds:g} s in each cell; the worst, and the median:",
        "",
        *table("line | bytes lost | mode", plain),
        "",
        "The same with one byte in a thousand lost, and something that happens half-way:",
        "",
        *table("event | line | mode", disturbed),
    ]
    text = "\n".join(lines)
    print(text)
    before, rest = DOCUMENT.read_text().split(BEGIN)
    DOCUMENT.write_text(f"{before}{BEGIN}\n{text}\n{END}{rest.split(END)[1]}")


if __name__ == "__main__":
    main()
