# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Integrity of the LOIS ECU's codec on a line that loses or adds bytes (``make integrity``).

The *true* reports are those from the undamaged stream. Each report from a damaged stream is
compared with the true reports that follow the last match. A report that is equal to none of these
is wrong. The simulated board shares no code with the driver.
"""

from collections import Counter
from dataclasses import dataclass, fields
from functools import partial
from random import Random
from typing import Final

from carriage import FAULTS
from pieces import damaged, scores_of

from omnibot_driver.core.lois_ecu import LoisDecoder
from omnibot_driver.core.lois_ecu.messages import Report
from omnibot_driver.simulator.lois_ecu import QUIRKS, Firmware, LoisSettings, SimulatedLois

TICK_S: Final = 0.01
STEER_EVERY: Final = 100
"""Number of the board's ticks between two commands."""
LEAST_DELIVERED: Final = {"1 byte in 1,000 lost": 0.9, "1 byte in 100 lost": 0.5}
"""For each fault, the least share of the true reports that must be decoded.

No decoded report may be wrong.
"""

Stream = list[bytes]
"""The bytes that the board sends, with one entry for each tick."""


@dataclass(slots=True)
class Score:
    """Counts of decoded lines of text and of reports. Scores can be added.

    ``sent``: reports in the undamaged stream.

    ``lines``, ``lines_out``: valid lines of text in the undamaged and in the damaged stream.
    """

    lines: int = 0
    lines_out: int = 0
    sent: int = 0
    out: int = 0
    wrong: int = 0

    def __iadd__(self, other: "Score") -> "Score":
        for name in (field.name for field in fields(self)):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        return self


def drive(firmware: Firmware, seed: int, seconds: float) -> Stream:
    """Drive a board with new wheel speeds each second, and return what the board sends."""
    random = Random(f"{firmware} {seed}")
    board = SimulatedLois(LoisSettings(quirks=QUIRKS[firmware], seed=seed, running=True))
    stream = []
    board.receive(b":233f80000066\n")  # low-pass 1, without which nothing turns
    for tick in range(round(seconds / TICK_S)):
        if tick % STEER_EVERY == 0:
            left, right = (random.randrange(5, 40) for _ in range(2))
            text = f":02{left:04x}{right:04x}"
            check = 0
            for character in text.encode():
                check ^= character
            board.receive(f"{text}{check:02x}\n".encode())
        stream.append(board.step())
    return stream


def decode(stream: Stream) -> tuple[list[Report], int]:
    """Return all reports that are decoded from a stream, and the number of its valid lines."""
    decoder, found = LoisDecoder(), list[Report]()
    for tick, data in enumerate(stream):
        found += decoder.feed(data, tick * TICK_S)
    found += decoder.flush(len(stream) * TICK_S)
    return found, decoder.statistics.lines


def score(truth: list[Report], lines: int, stream: Stream) -> Score:
    """Count the reports of a damaged stream, and the wrong reports among them."""
    found, lines_out = decode(stream)
    result = Score(lines=lines, lines_out=lines_out, sent=len(truth), out=len(found))
    left = Counter(map(repr, truth))
    at = 0
    for report in found:
        text = repr(report)
        if not left[text]:  # texts, because NaN is not equal to NaN
            result.wrong += 1
            continue
        place = next((n for n in range(at, len(truth)) if repr(truth[n]) == text), None)
        if place is None:
            result.wrong += 1
        else:
            at = place + 1
    return result


def one(seconds: float, job: tuple[Firmware, int]) -> dict[tuple[str, str], Score]:
    """Damage one stream with each fault, and return the scores."""
    firmware, seed = job
    stream = drive(firmware, seed, seconds)
    truth, lines = decode(stream)
    return {
        (fault, firmware): score(
            truth, lines, damaged(stream, line, Random(f"{firmware} {seed} {fault}"))
        )
        for fault, line in FAULTS.items()
        if not fault.startswith("none")
    }


def measure(seconds: float, seeds: range) -> tuple[list[str], bool]:
    """Return the rows of the table, and whether every bound holds."""
    jobs = [(firmware, seed) for seed in seeds for firmware in QUIRKS]
    total = scores_of(partial(one, seconds), jobs)
    lines = [
        f"{len(seeds)} streams of {seconds:g} s of each firmware:",
        "",
        "| fault | firmware | lines delivered | reports delivered | reports wrong | bound | |",
        "|---" * 7 + "|",
    ]
    all_hold = True
    for (fault, firmware), found in total.items():
        least = LEAST_DELIVERED.get(fault, 0.0)
        delivered = (found.out - found.wrong) / max(1, found.sent)
        holds = not least or (not found.wrong and delivered >= least)
        all_hold &= holds
        bound = f"none wrong, {least:.0%} delivered" if least else "none"
        wrong = f"1 in {found.out / found.wrong:,.0f}" if found.wrong else f"0 of {found.out:,}"
        lines.append(
            f"| {fault} | {firmware} | {found.lines_out / found.lines:.2%} | {delivered:.2%} |"
            f" {wrong} | {bound} | {'holds' if holds else '**missed**'} |"
        )
    return lines, all_hold
