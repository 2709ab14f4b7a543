# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Readings of a LOIS ECU other than odometry, in SI units and REP-103 axes: values only.

The messages EStopButton, Record and TerminalLine serve as readings too.
"""

from dataclasses import dataclass

from omnibot_driver.core.lois_ecu.messages import EStopButton, Record, TerminalLine
from omnibot_driver.core.lois_ecu.odometry import FusedOdometry
from omnibot_driver.core.readings import DisplacementReading


@dataclass(frozen=True, slots=True)
class FixReading:
    """GPS position in degrees, north and east positive.

    ``valid``: whether the position is not 0/0, and the GPS has a date.
    """

    latitude_deg: float
    longitude_deg: float
    valid: bool


@dataclass(frozen=True, slots=True)
class TimeReading:
    """Time of the GPS, in s of UTC since 1970; None while the date is unknown."""

    utc_s: int | None


@dataclass(frozen=True, slots=True)
class HeadingReading:
    """Yaw in ENU, in rad: counter-clockwise from east, -pi..pi."""

    yaw_rad: float


@dataclass(frozen=True, slots=True)
class RecordReading:
    """A requested record. ``count_s``: time unit of an RPM record in s, None while unknown."""

    record: Record
    count_s: float | None
    ticks_per_revolution: int


@dataclass(frozen=True, slots=True)
class RecordComes:
    """Notice that lines of a requested record are arriving; a complete record takes up to 1.3 s."""


@dataclass(frozen=True, slots=True)
class RecordFailed:
    """Notice that a requested record will not come; ``reason``: the cause, and what to do."""

    reason: str


@dataclass(frozen=True, slots=True)
class TerminalLeft:
    """Notice that a terminal mode has ended.

    During a terminal mode, the driver does not receive presses of the e-stop button.
    """


LoisReading = (
    DisplacementReading
    | FusedOdometry
    | FixReading
    | TimeReading
    | HeadingReading
    | EStopButton
    | Record
    | RecordReading
    | RecordComes
    | RecordFailed
    | TerminalLine
    | TerminalLeft
)
