"""The integrity report: ``make integrity`` prints it and writes it into docs/integrity.md.

Arguments: ``--seconds`` of each stream and ``--seeds``. Ends with 1 when a bound is missed.
"""

import argparse
import os
import sys
from functools import partial
from multiprocessing import Pool
from pathlib import Path

from bounds import BOUNDS, Scores, add, over_scenarios, run
from judge import Score
from truth import CHUNKERS, FAULTS, SCENARIOS

DOCUMENT = Path(__file__).parents[2] / "docs" / "integrity.md"
BEGIN, END = "<!-- figures: begin -->", "<!-- figures: end -->"

SEEDS_OF_THE_PLAIN_PARSER = 4
"""It is wrong so often that a few streams tell."""

Job = tuple[str, int, str]


def one(seconds: float, job: Job) -> tuple[str, Scores]:
    """One stream, in a process of the pool."""
    scenario, seed, parser = job
    return parser, run(scenario, seed, seconds, parser)


def rate(score: Score) -> str:
    """Wrong frames among those that came out."""
    return f"1 in {score.out / score.wrong:,.0f}" if score.wrong else f"0 of {score.out:,}"


def bound_of(fault: str, chunker: str) -> str:
    """The bound in words."""
    bound = BOUNDS[fault]
    if chunker not in bound.chunkers:
        return "none"
    one_in = bound.one_wrong_in(chunker)
    wrong = f"1 in {one_in:,}" if one_in else "0"
    return f"{wrong}; " + ("all" if bound.delivered == 1.0 else f"{bound.delivered:.1%}")


def table(ours: Scores, plain: Scores) -> tuple[list[str], bool]:
    """Rows of the two tables, and whether every bound holds."""
    lines = [
        "| fault | chunking | wrong | delivered | bound | plain parser: wrong | delivered |",
        "|---|---|---|---|---|---|---|",
    ]
    all_hold = True
    for fault in FAULTS:
        for chunker in CHUNKERS:
            score = over_scenarios(ours, fault, chunker)
            other = over_scenarios(plain, fault, chunker)
            holds = BOUNDS[fault].holds(chunker, score)
            all_hold &= holds
            lines.append(
                f"| {fault} | {chunker} | {rate(score)} | {score.delivered / score.intact:.3%} | "
                f"{bound_of(fault, chunker)}{'' if holds else ' **missed**'} | "
                f"{rate(other)} | {other.delivered / other.intact:.3%} |"
            )
    lines += ["", "Wrong frames and share delivered by scenario, all chunkings together:", ""]
    lines += ["| fault | " + " | ".join(SCENARIOS) + " |", "|---" * (len(SCENARIOS) + 1) + "|"]
    for fault in FAULTS:
        cells = []
        for scenario in SCENARIOS:
            total = Score()
            for chunker in CHUNKERS:
                total += ours[fault, chunker, scenario]
            cells.append(f"{rate(total)}; {total.delivered / total.intact:.2%}")
        lines.append(f"| {fault} | " + " | ".join(cells) + " |")
    return lines, all_hold


def main() -> int:
    """Run, print, write."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--seconds", type=float, default=120.0)
    arguments.add_argument("--seeds", type=int, default=20)
    chosen = arguments.parse_args()
    jobs = [
        (scenario, seed, parser)
        for seed in range(chosen.seeds)
        for scenario in SCENARIOS
        for parser in ("driver", "plain")
        if parser == "driver" or seed < SEEDS_OF_THE_PLAIN_PARSER
    ]
    totals: dict[str, Scores] = {"driver": {}, "plain": {}}
    with Pool(os.cpu_count()) as pool:
        for done, (parser, scores) in enumerate(
            pool.imap_unordered(partial(one, chosen.seconds), jobs), 1
        ):
            add(totals[parser], scores)
            print(f"\r{done} of {len(jobs)} streams", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    lines, all_hold = table(totals["driver"], totals["plain"])
    streams = (
        f"{chosen.seeds} streams of {chosen.seconds:g} s for each scenario, fault and chunking:"
    )
    figures = "\n".join([streams, "", *lines])
    print(figures)
    text = DOCUMENT.read_text()
    before, rest = text.split(BEGIN)
    after = rest.split(END)[1]
    DOCUMENT.write_text(f"{before}{BEGIN}\n{figures}\n{END}{after}")
    return 0 if all_hold else 1


if __name__ == "__main__":
    sys.exit(main())
