# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The outbound report: ``make integrity`` writes it into docs/internals/integrity.md.

In simulated trials, a damaged line carries the driver's bytes to a receiver, whose errors are
counted. The exit code is 1 if the errors exceed a limit.

``--share``: run only this share of the trials, and write nothing.

``--examples``: show bytes that led to errors.
"""

import argparse
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from outbound_judge import Score
from outbound_line import LOSSES, OTHERS
from outbound_runs import RECEIVERS, SCRIPTS, Scores, over, run
from outbound_scenes import DRIVES, SCENES

DOCUMENT: Final = Path(__file__).parents[2] / "docs" / "internals" / "integrity.md"
OTHERWISE: Final = {
    "lois_ecu": "lines to the board carry a checksum; its tests try each loss of two characters",
    "mart": "a datagram is lost whole or not at all; its tests try such losses",
    "fejemis": "lines to the board carry a checksum; its tests try each loss of two characters",
}
"""Boards that this report does not measure, each with the reason."""
BEGIN, END = "<!-- outbound: begin -->", "<!-- outbound: end -->"


@dataclass(frozen=True, slots=True)
class Bound:
    """Limits of the errors that ``outbound_judge`` defines.

    Stray motion and false letters are never allowed.

    ``share``: largest allowed share of the driving time in which an uncommanded set-point is
    active.

    ``long_in``: the number N in "at most one uncommanded set-point of over 2 ms in N control
    frames".

    ``overdue``: whether it is an error that the robot still drives when it must be at rest, or at
    the end of the trial.
    """

    share: float = 1.0
    long_in: float = 1.0
    overdue: bool = True

    def missed(self, score: Score) -> list[str]:
        """Return the names of the errors in ``score`` that exceed these limits."""
        found = {
            "stray motion": score.strayed,
            "false letters": score.false_letters,
            "still driving": score.overdue + score.for_good if self.overdue else 0,
            "uncommanded": score.uncommanded_s > self.share * score.driving_s,
            "longer than 2 ms": score.long * self.long_in > score.frames,
        }
        return [name for name, beyond in found.items() if beyond]


BOUNDS: Final[dict[str, Bound]] = dict(
    zip(
        LOSSES,
        (Bound(5e-4, 5_000), Bound(1.5e-2, 100), Bound(overdue=False)),
        strict=True,
    )
)


def none_of(count: int, total: int) -> str:
    """Format a count that should be zero as "0 of N". A count that is not zero is bold."""
    return f"0 of {total:,}" if not count else f"**{count:,} of {total:,}**"


def one_in(count: int, total: int) -> str:
    """Format a rate as "1 in N"."""
    return f"1 in {total / count:,.0f}" if count else f"0 of {total:,}"


def ms(seconds: float) -> str:
    """Format a time in ms. Zero is a dash."""
    return f"{1e3 * seconds:.1f} ms" if seconds else "-"


def share(score: Score) -> str:
    """Format the share of the driving time with an uncommanded set-point, in percent."""
    return f"{score.uncommanded_s / score.driving_s:.3%}" if score.driving_s else "-"


def table(scores: Scores) -> tuple[list[str], bool]:
    """Return the lines of the tables, and whether the errors of all receivers are within limits."""
    lines = [
        "| loss | receiver | trials with stray motion | still driving | uncommanded, of the time "
        "| longer than 2 ms, of the frames | longest | false letters | |",
        "|---" * 9 + "|",
    ]
    all_hold = True
    for fault, bound in BOUNDS.items():
        wanted = f"≤ {bound.share:.2%} | ≤ 1 in {bound.long_in:,}" if bound.share < 1 else " | "
        due = "0" if bound.overdue else ""
        lines.append(f"| {fault} | *bound* | 0 | {due} | {wanted} | | 0 | |")
        for receiver in RECEIVERS:
            score = over(scores, fault=fault, receiver=receiver)
            missed = bound.missed(score)
            all_hold &= not missed
            lines.append(
                f"| | {receiver} | {none_of(score.strayed, score.trials)} |"
                f" {none_of(score.overdue + score.for_good, score.trials)} |"
                f" {share(score)} |"
                f" {one_in(score.long, score.frames)} | {ms(score.longest_s)} |"
                f" {score.false_letters} |"
                f" {'**missed**: ' + ', '.join(missed) if missed else 'holds'} |"
            )
    rates, rates_hold = _by_rate(scores)
    lines += ["", *rates, "", *_by_scene(scores), "", *_others(scores)]
    return lines, all_hold and rates_hold


def _by_rate(scores: Scores) -> tuple[list[str], bool]:
    lines = [
        "Drives without a stop, on the worst receiver (in parentheses: on the best):",
        "",
        "| loss | commands a second | frames a second | uncommanded, of the time |"
        " longer than 2 ms, of the frames | longest | |",
        "|---" * 7 + "|",
    ]
    all_hold = True
    for fault, bound in BOUNDS.items():
        for scene in DRIVES:
            each = [over(scores, fault=fault, receiver=one, scene=scene) for one in RECEIVERS]
            if not all(score.driving_s for score in each):
                continue
            share = sorted(score.uncommanded_s / score.driving_s for score in each)
            most = max(each, key=lambda score: score.long / score.frames)
            least = min(each, key=lambda score: score.long / score.frames)
            missed = sorted({name for score in each for name in bound.missed(score)})
            all_hold &= not missed
            lines.append(
                f"| {fault} | {scene.split()[1]} | {most.frames / most.driving_s:.0f} |"
                f" {share[-1]:.3%} ({share[0]:.3%}) |"
                f" {one_in(most.long, most.frames)} ({one_in(least.long, least.frames)}) |"
                f" {ms(max(score.longest_s for score in each))} |"
                f" {'**missed**: ' + ', '.join(missed) if missed else 'holds'} |"
            )
    return lines, all_hold


def _by_scene(scores: Scores) -> Iterator[str]:
    yield "Trials with stray motion, and trials still driving, by scene (all receivers together):"
    yield ""
    yield "| scene | " + " | ".join(LOSSES) + " |"
    yield "|---" * (len(LOSSES) + 1) + "|"
    for scene in sorted({scene for _, _, scene in scores} - set(DRIVES)):
        cells = []
        for fault in LOSSES:
            score = over(scores, fault=fault, scene=scene)
            cells.append(
                f"{none_of(score.strayed, score.trials)};"
                f" {none_of(score.overdue + score.for_good, score.trials)}"
            )
        yield f"| {scene} | " + " | ".join(cells) + " |"


def _others(scores: Scores) -> Iterator[str]:
    yield "These faults have no bound. All receivers together (in parentheses: the worst of them):"
    yield ""
    yield (
        "| fault | trials with stray motion | longest | still driving when due | at the end"
        " | uncommanded, of the time"
        " | longer than 2 ms, of the frames | longest | letters: false | added by the line"
        " | e-stops not sent |"
    )
    yield "|---" * 11 + "|"
    for fault in OTHERS:
        score = over(scores, fault=fault)
        each = {name: over(scores, fault=fault, receiver=name) for name in RECEIVERS}
        most = max(each, key=lambda name: each[name].strayed)
        shares = (one.uncommanded_s / one.driving_s for one in each.values() if one.driving_s)
        most_of_time = max(shares, default=0.0)
        yield (
            f"| {fault} | {one_in(score.strayed, score.trials)}"
            f" ({one_in(each[most].strayed, each[most].trials)}: {most}) | {ms(score.stray_s)} |"
            f" {one_in(score.overdue, score.trials)} | {one_in(score.for_good, score.trials)} |"
            f" {share(score)} ({most_of_time:.3%}) |"
            f" {one_in(score.long, score.frames)} | {ms(score.longest_s)} |"
            f" {score.false_letters} | {score.added_letters} | {score.false_estops} |"
        )


def main() -> int:
    """Run the trials, print the results and write them. Return the exit code."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument(
        "--board", choices=("omnibot", *OTHERWISE), default="omnibot", help="board to measure"
    )
    arguments.add_argument("--share", type=float, default=1.0)
    arguments.add_argument("--scripts", type=int, default=SCRIPTS)
    arguments.add_argument("--scene", action="append", choices=SCENES, default=[])
    arguments.add_argument("--examples", action="store_true")
    chosen = arguments.parse_args()
    if chosen.board in OTHERWISE:
        print(f"{chosen.board} is not measured here: {OTHERWISE[chosen.board]}")
        return 0
    begin_s = time.monotonic()
    kinds = tuple(chosen.scene) or tuple(SCENES)
    scores, rehearsals = run(chosen.share, chosen.scripts, kinds)
    lines, all_hold = table(scores)
    number = sum(score.trials for score in scores.values())
    heading = (
        f"{number:,} trials of {chosen.scripts} scripts for each scene. For these trials, the"
        f" session ran {rehearsals:,} times:"
    )
    figures = "\n".join([heading, "", *lines])
    print(figures)
    print(f"\n{time.monotonic() - begin_s:.0f} s")
    if chosen.examples:
        for (fault, _, _), score in scores.items():
            print(*(f"{fault}: {example}" for example in score.examples), sep="\n")
    if chosen.share == 1.0 and chosen.scripts == SCRIPTS and not chosen.scene:
        before, rest = DOCUMENT.read_text().split(BEGIN)
        DOCUMENT.write_text(f"{before}{BEGIN}\n{figures}\n{END}{rest.split(END)[1]}")
    return 0 if all_hold else 1


if __name__ == "__main__":
    sys.exit(main())
