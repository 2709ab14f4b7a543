# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The timing report, which writes the accuracy of stamps into docs/internals/time.md.

``--seconds``: length of each stream. ``--seeds``: number of streams for each row of a table. The
streams use the clock skews of ``SKEWS`` in turn. ``--readers``: measure only the stamps on
a busy computer.
"""

import argparse
import os
import sys
from functools import partial
from multiprocessing import Pool
from pathlib import Path

from stamping import BUSY, EVENTS_S, LINES, SETTLED_S, spread, stamp

DOCUMENT = Path(__file__).parents[2] / "docs" / "internals" / "time.md"
MARKS = "<!-- {}: begin -->", "<!-- {}: end -->"

SKEWS = (-1e-4, -5e-5, 0.0, 5e-5, 1e-4)
LOSSES = (0.0, 1e-3, 1e-2)
SCENARIOS = {"nominal": "driving", "IMU only": "IMU only, noisy gyro"}
BLOCKS = "4096-byte blocks"
BLOCKS_SETTLED_S = 6.0
"""Time in s after which the driver's clock has settled on a line that delivers large blocks.

Two blocks arrive in this time.
"""
LIMITS_S = (0.2e-3, 0.5e-3)

Cell = tuple[str, float, str, str]
"""One case of the report: the line, the share of lost bytes, the mode, and the event."""
Figures = tuple[float, float]
"""Two results for one stream, in s: the RMS error of the steps between stamps, and half the width
of the interval that contains 99 % of the stamps' errors."""


def one(seconds: float, job: tuple[Cell, int]) -> tuple[Cell, Figures]:
    """Stamp one stream, in a process of the pool. Return the case and the result."""
    (line, loss, mode, event), seed = job
    skew = SKEWS[seed % len(SKEWS)]
    stamped = stamp(line, SCENARIOS[mode], loss, skew, seed, seconds, event)
    since_s = BLOCKS_SETTLED_S if line == BLOCKS else SETTLED_S
    return job[0], (stamped.unevenness(since_s), spread(stamped.errors(since_s)))


def table(head: str, rows: dict[str, list[Figures]]) -> list[str]:
    """Return the lines of a Markdown table with one row for each case.

    A row has the worst and the median result, and how many streams keep ``LIMITS_S``.

    ``head``: headings of the case's columns.
    """
    lines = [
        f"| {head} | steps, RMS error (ms) | 99 % within (ms) | streams that keep both limits |",
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


def measured(cells: list[Cell], seconds: float, seeds: int) -> dict[Cell, list[Figures]]:
    """Stamp several streams for each case, and return the results by case.

    ``seeds``: number of streams for each case. ``seconds``: length of each stream. The streams are
    generated and stamped on all processors at the same time.
    """
    jobs = [(cell, seed) for cell in cells for seed in range(seeds)]
    found: dict[Cell, list[Figures]] = {cell: [] for cell in cells}
    with Pool(os.cpu_count()) as pool:
        for cell, figures in pool.imap_unordered(partial(one, seconds), jobs, chunksize=4):
            found[cell].append(figures)
            done = sum(map(len, found.values()))
            print(f"\r{done} of {len(jobs)} streams", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return found


def publish(name: str, lines: list[str]) -> None:
    """Print the lines, and write them into docs/internals/time.md.

    The lines replace the text between the two comments in this document that contain ``name``.
    """
    text = "\n".join(lines)
    print(text)
    begin, end = (mark.format(name) for mark in MARKS)
    before, rest = DOCUMENT.read_text().split(begin)
    DOCUMENT.write_text(f"{before}{begin}\n{text}\n{end}{rest.split(end)[1]}")


def lines_and_events(seconds: float, seeds: int) -> None:
    """Measure the stamps on each kind of line, without an event and with each kind of event.

    Events, which ``BLOCKS`` omits, are a restart of the board and stalls of the host. The results
    are written into docs/internals/time.md.
    """
    undisturbed, *events = EVENTS_S
    cells = [(line, n, mode, undisturbed) for line in LINES for n in LOSSES for mode in SCENARIOS]
    cells += [
        (line, 1e-3, mode, event)
        for event in events
        for line in LINES
        if line != BLOCKS
        for mode in SCENARIOS
    ]
    found = measured(cells, seconds, seeds)
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
        f"The worst of {seeds} streams of {seconds:g} s in each cell (in parentheses: the median):",
        "",
        *table("line | bytes lost | mode", plain),
        "",
        "One byte in a thousand is lost, and an event happens half-way:",
        "",
        *table("event | line | mode", disturbed),
    ]
    publish("figures", lines)


def busy_readers(seconds: float, seeds: int) -> None:
    """Measure stamps of hosts that read late."""
    cells = [(line, n, mode, "none") for line in BUSY for n in LOSSES[:2] for mode in SCENARIOS]
    found = measured(cells, seconds, seeds)
    rows = {f"{line} | {n:g} | {mode}": figures for (line, n, mode, _), figures in found.items()}
    lines = [
        f"The worst of {seeds} streams of {seconds:g} s in each cell (in parentheses: the median):",
        "",
        *table("reader | bytes lost | mode", rows),
    ]
    publish("readers", lines)


def main() -> None:
    """Measure the streams, print the results, and write them into the document."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--seconds", type=float, default=30.0)
    arguments.add_argument("--seeds", type=int, default=30)
    arguments.add_argument("--readers", action="store_true")
    chosen = arguments.parse_args()
    if not chosen.readers:
        lines_and_events(chosen.seconds, chosen.seeds)
    busy_readers(chosen.seconds, chosen.seeds)


if __name__ == "__main__":
    main()
