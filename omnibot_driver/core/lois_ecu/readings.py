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
    """Degrees, north and east positive. ``valid``: it is not 0/0."""

    latitude_deg: float
    longitude_deg: float
    valid: bool


@dataclass(frozen=True, slots=True)
class TimeReading:
    """Time of the GPS, in s of UTC since 1970; None while the date is unknown."""

    utc_s: int | None


@dataclass(frozen=True, slots=True)
class HeadingReading:
    """Yaw in ENU: counter-clockwise from east, -pi..pi."""

    yaw_rad: float


@dataclass(frozen=True, slots=True)
class RecordReading:
    """A record that was asked for. ``count_s``: unit of an RPM record, None while it is unknown."""

    record: Record
    count_s: float | None
    ticks_per_revolution: int


@dataclass(frozen=True, slots=True)
class RecordComes:
    """Lines of a record that was asked for came in; a whole one takes up to 1.3 s."""


@dataclass(frozen=True, slots=True)
class RecordFailed:
    """A record that was asked for is not going to come; ``reason``: why, and what to do."""

    reason: str


@dataclass(frozen=True, slots=True)
class TerminalLeft:
    """The board speaks for itself again; a press of its button meanwhile is unknown."""


@dataclass(frozen=True, slots=True)
class WheelReading:
    """Rotation of both wheels since the last reading, in rad, by ticks where they count."""

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
    | RecordReading
    | RecordComes
    | RecordFailed
    | TerminalLine
    | TerminalLeft
)
