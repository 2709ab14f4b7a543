# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The integrity report: ``make integrity`` writes it into docs/internals/integrity.md.

``--seconds``: length of a stream. ``--seeds``: number of seeds. ``--first``: first seed. All seeds
should be below 1000, because the OmniBot's decoder was tuned with higher seeds. The exit code is 1
when a bound is missed.
"""

import argparse
import os
import sys
from functools import partial
from importlib import import_module
from multiprocessing import Pool
from pathlib import Path

from bounds import BOUNDS, PLAIN_CHUNKING, Scores, chunkings, over_chunkers, over_scenarios, run
from carriage import FAULTS
from judge import Score
from pieces import add
from truth import SCENARIOS, WITH_TEXTS

DOCUMENT = Path(__file__).parents[2] / "docs" / "internals" / "integrity.md"
BEGIN, END = "<!-- figures: begin -->", "<!-- figures: end -->"

OTHERS = {"lois_ecu": "lois_ecu_report", "mart": "mart_report", "fejemis": "fejemis_report"}
"""For each board other than the OmniBot, the module that measures the board's codec."""
SEEDS_OF_THE_PLAIN_PARSER = 4
"""Number of streams for the plain parser. Its errors are frequent, so a few streams suffice."""

Job = tuple[str, int, str]


def one(seconds: float, job: Job) -> tuple[str, Scores]:
    """Return a parser's name and its scores for one stream. The call runs in another process."""
    scenario, seed, parser = job
    return parser, run(scenario, seed, seconds, parser)


def rate(score: Score) -> str:
    """Return the share of wrong frames among those decoded, as text."""
    return f"1 in {score.out / score.wrong:,.0f}" if score.wrong else f"0 of {score.out:,}"


def bound_of(fault: str, chunker: str) -> str:
    """Return, as text, the bounds for wrong and delivered frames with this fault and chunking."""
    bound = BOUNDS[fault]
    if chunker not in bound.chunkers:
        return "none"
    one_in = bound.one_wrong_in(chunker)
    wrong = f"1 in {one_in:,}" if one_in else "0"
    share = bound.share(chunker)
    return f"{wrong}; " + ("all" if share == 1.0 else f"{100 * share:.4g} %")


def table(ours: Scores, plain: Scores) -> tuple[list[str], bool]:
    """Return the rows of the tables, and whether every bound holds in every scenario."""
    lines = [
        "| fault | chunking or reader | wrong | delivered | bound for each scenario "
        "| most wrong in one scenario | least delivered in one "
        "| plain parser: wrong | delivered |",
        "|---" * 9 + "|",
    ]
    all_hold = True
    for fault, bound in BOUNDS.items():
        other = over_scenarios(plain, fault, PLAIN_CHUNKING)
        for chunker in chunkings(fault):
            score = over_scenarios(ours, fault, chunker)
            each = {name: ours[fault, chunker, name] for name in SCENARIOS}
            missed = [name for name in SCENARIOS if not bound.holds(chunker, each[name])]
            all_hold &= not missed
            worst = max(SCENARIOS, key=lambda name: each[name].wrong_share)
            least = min(score.delivered_share for score in each.values())
            lines.append(
                f"| {fault} | {chunker} | {rate(score)} | {score.delivered_share:.2%} | "
                f"{bound_of(fault, chunker)}"
                f"{'; **missed**: ' if missed else ''}{', '.join(missed)} | "
                f"{rate(each[worst])}{f' ({worst})' if score.wrong else ''} | {least:.2%} | "
                f"{rate(other)} | {other.delivered_share:.2%} |"
            )
    lines += ["", "Wrong frames and share delivered by scenario, all chunkings together:", ""]
    lines += ["| fault | " + " | ".join(SCENARIOS) + " |", "|---" * (len(SCENARIOS) + 1) + "|"]
    for fault in FAULTS:
        totals = [over_chunkers(ours, fault, scenario) for scenario in SCENARIOS]
        cells = [f"{rate(total)}; {total.delivered_share:.2%}" for total in totals]
        lines.append(f"| {fault} | " + " | ".join(cells) + " |")
    lines += ["", "Texts of a paused board that arrived intact, and their delivered share:", ""]
    lines += ["| fault | texts delivered |", "|---|---|"]
    for fault in FAULTS:
        total = over_chunkers(ours, fault, WITH_TEXTS)
        share = total.texts_delivered / max(1, total.texts)
        lines.append(f"| {fault} | {share:.2%} of {total.texts:,} |")
    return lines, all_hold


def main() -> int:
    """Measure the streams, print the results and write them. Return the exit code."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--seconds", type=float, default=60.0)
    arguments.add_argument(
        "--board", choices=("omnibot", *OTHERS), default="omnibot", help="board to measure"
    )
    arguments.add_argument("--seeds", type=int, default=10)
    arguments.add_argument("--first", type=int, default=400)
    chosen = arguments.parse_args()
    if chosen.board in OTHERS:
        seeds = range(chosen.first, chosen.first + chosen.seeds)
        lines, all_hold = import_module(OTHERS[chosen.board]).measure(chosen.seconds, seeds)
        return write(
            "\n".join(lines), BEGIN.replace("figures", f"figures of {chosen.board}"), all_hold
        )
    jobs = [
        (scenario, seed, parser)
        for seed in range(chosen.first, chosen.first + chosen.seeds)
        for scenario in SCENARIOS
        for parser in ("driver", "plain")
        if parser == "driver" or seed < chosen.first + SEEDS_OF_THE_PLAIN_PARSER
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
    return write(figures, BEGIN, all_hold)


def write(figures: str, begin: str, all_hold: bool) -> int:
    """Print the figures, write them into docs/internals/integrity.md, and return the exit code.

    The figures replace the text between ``begin`` and ``END``. The exit code is 0 if all limits
    hold, else 1.
    """
    print(figures)
    before, rest = DOCUMENT.read_text().split(begin)
    after = rest.split(END, 1)[1]
    DOCUMENT.write_text(f"{before}{begin}\n{figures}\n{END}{after}")
    return 0 if all_hold else 1


if __name__ == "__main__":
    sys.exit(main())
