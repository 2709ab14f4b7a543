# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What can be said of a drive: how good it is, the figure, and what to do."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum


class Level(IntEnum):
    """NOTE: worth knowing, nothing to do. BAD: the robot or the recording is not to be trusted."""

    GOOD = 0
    NOTE = 1
    WARN = 2
    BAD = 3


@dataclass(frozen=True, slots=True)
class Finding:
    """One sentence with its figure; ``advice`` is what to do, empty where there is nothing."""

    level: Level
    subject: str
    text: str
    advice: str = ""


def headline(findings: Iterable[Finding]) -> str:
    """Summarise all findings in one line."""
    levels = [finding.level for finding in findings]
    bad, warn = levels.count(Level.BAD), levels.count(Level.WARN)
    if bad:
        also = f", {warn} to be looked at" if warn else ""
        return f"Not healthy: {bad} {'things are' if bad > 1 else 'thing is'} wrong{also}."
    if warn:
        return f"Usable: {warn} {'things are' if warn > 1 else 'thing is'} to be looked at."
    return "Healthy."


def span(seconds: float) -> str:
    """A length of time for people."""
    if seconds < 120.0:
        return f"{seconds:.3g} s" if seconds < 99.5 else f"{seconds:.0f} s"
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02} min" if hours else f"{minutes} min {seconds:02} s"


def counted(number: int, thing: str) -> str:
    """A number with its noun in singular or plural."""
    return f"{number} {thing}{'' if number == 1 else 's'}"
