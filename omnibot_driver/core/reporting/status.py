# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A verdict: a level, a sentence, and the figures behind it."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

RUNNING: Final = ("nominal", "imu_only")
"""States in which a board sends measurements."""


class Level(IntEnum):
    """The levels of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True, slots=True)
class Status:
    """A diagnostic status: a verdict and its figures."""

    name: str
    level: Level
    message: str
    values: Mapping[str, str]
