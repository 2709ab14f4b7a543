# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The findings of a report. Each has a level, a sentence with a measured value, and advice."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum


class Level(IntEnum):
    """The level of a finding.

    ``NOTE``: the reader should know this, but need not act.

    ``BAD``: the robot or the recording cannot be trusted.
    """

    GOOD = 0
    NOTE = 1
    WARN = 2
    BAD = 3


@dataclass(frozen=True, slots=True)
class Finding:
    """One result of the report: a sentence with a measured value.

    ``subject``: what the finding is about, such as "Timing".
    ``advice``: what the reader should do; empty if nothing.
    """

    level: Level
    subject: str
    text: str
    advice: str = ""


def headline(findings: Iterable[Finding]) -> str:
    """Return one line that summarises all findings."""
    levels = [finding.level for finding in findings]
    bad, warn = levels.count(Level.BAD), levels.count(Level.WARN)
    if bad:
        also = f", {warn} to check" if warn else ""
        return f"Not healthy: {bad} {'things are' if bad > 1 else 'thing is'} wrong{also}."
    if warn:
        return f"Usable: {warn} {'things' if warn > 1 else 'thing'} to check."
    return "Healthy."


def span(seconds: float) -> str:
    """Return a duration as text, such as "2 min 05 s"."""
    if seconds < 120.0:
        return f"{seconds:.3g} s" if seconds < 99.5 else f"{seconds:.0f} s"
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02} min" if hours else f"{minutes} min {seconds:02} s"


def counted(number: int, thing: str) -> str:
    """Return a number with its noun in singular or plural."""
    return f"{number} {thing}{'' if number == 1 else 's'}"
