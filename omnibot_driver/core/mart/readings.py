# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What only a MART controller measures or answers, in SI units: values only."""

from dataclasses import dataclass
from typing import Literal

Side = Literal["front", "rear"]


@dataclass(frozen=True, slots=True)
class BatteryReading:
    """The main battery."""

    volts: float


@dataclass(frozen=True, slots=True)
class SonarReading:
    """``distance_m`` is infinite where nothing is seen, or the sonar answers -1."""

    side: Side
    distance_m: float


@dataclass(frozen=True, slots=True)
class DockedReading:
    """Whether the robot stands at its dock."""

    docked: bool


@dataclass(frozen=True, slots=True)
class JobDone:
    """The result of a service. ``name``, ``content``: of a file, if one was requested."""

    token: object
    success: bool
    message: str
    name: str = ""
    content: bytes = b""
