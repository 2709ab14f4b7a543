# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A diagnostic status: a level, a sentence, and the figures that it is based on."""

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
    """One diagnostic status: its name, level and message, and figures by label."""

    name: str
    level: Level
    message: str
    values: Mapping[str, str]
