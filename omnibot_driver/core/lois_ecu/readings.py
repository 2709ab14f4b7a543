# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What a LOIS ECU measured besides motion, in SI units and REP-103's axes; values only.

EStopButton, Record and TerminalLine are passed on as they are.
"""

from dataclasses import dataclass

from omnibot_driver.core.lois_ecu.messages import EStopButton, Record, TerminalLine
from omnibot_driver.core.lois_ecu.odometry import FusedOdometry
from omnibot_driver.core.readings import DisplacementReading


@dataclass(frozen=True, slots=True)
class FixReading:
    """Degrees, north and east positive. ``valid``: it is no 0/0."""

    latitude_deg: float
    longitude_deg: float
    valid: bool


@dataclass(frozen=True, slots=True)
class TimeReading:
    """Of the GPS, in s of UTC since 1970; None while the date is unknown."""

    utc_s: int | None


@dataclass(frozen=True, slots=True)
class HeadingReading:
    """Yaw in ENU: counter-clockwise from east, -pi..pi."""

    yaw_rad: float


@dataclass(frozen=True, slots=True)
class TerminalLeft:
    """The board speaks for itself again; a press of its button meanwhile is unknown."""


@dataclass(frozen=True, slots=True)
class WheelReading:
    """What both wheels turned since the last one, in rad, by ticks where they count."""

    left_rad: float
    right_rad: float
    measured: bool


LoisReading = (
    DisplacementReading
    | FusedOdometry
    | WheelReading
    | FixReading
    | TimeReading
    | HeadingReading
    | EStopButton
    | Record
    | TerminalLine
    | TerminalLeft
)
