# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Readings and results that only a MART controller delivers, in SI units: values only."""

from dataclasses import dataclass
from typing import Literal

from omnibot_driver.core.readings import Unstamped
from omnibot_driver.core.requests import RequestDone

Side = Literal["front", "rear"]


@dataclass(frozen=True, slots=True)
class BatteryReading:
    """The voltage of the main battery, in V."""

    volts: float


@dataclass(frozen=True, slots=True)
class SonarReading:
    """The distance to an obstacle, in m.

    ``distance_m`` is infinite if nothing is in range, or if the sonar answers -1.
    """

    side: Side
    distance_m: float


@dataclass(frozen=True, slots=True)
class DockedReading(Unstamped):
    """Whether the robot is at its dock."""

    docked: bool


@dataclass(frozen=True, slots=True)
class JobDone(RequestDone):
    """The result of a job, such as a gyro calibration, a docking move or a download.

    ``token``: the object by which the caller recognises the job.

    ``name``, ``content``: of the downloaded file; empty without a file.
    """

    name: str = ""
    content: bytes = b""
