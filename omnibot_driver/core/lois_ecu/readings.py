# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Readings of a LOIS ECU other than odometry.

Units and axes follow REP-103, except for GPS positions, which are in degrees.
The messages EStopButton, Record and TerminalLine serve as readings too.
"""

from dataclasses import dataclass

from omnibot_driver.core.lois_ecu.fused_odometry import FusedOdometry
from omnibot_driver.core.lois_ecu.messages import EStopButton, Record, TerminalLine
from omnibot_driver.core.readings import DisplacementReading, Unstamped


@dataclass(frozen=True, slots=True)
class FixReading:
    """GPS position in degrees, north and east positive.

    ``valid``: whether the GPS has a position and the date. Without a position, the GPS sends 0/0.
    """

    latitude_deg: float
    longitude_deg: float
    valid: bool


@dataclass(frozen=True, slots=True)
class TimeReading:
    """Time of the GPS, in s of UTC since 1970. None while the date is unknown."""

    utc_s: int | None


@dataclass(frozen=True, slots=True)
class HeadingReading:
    """Heading of the robot as a yaw in ENU, in rad: counter-clockwise from east, -pi..pi."""

    yaw_rad: float


@dataclass(frozen=True, slots=True)
class RecordReading(Unstamped):
    """A requested record that has arrived completely.

    ``count_s``: time unit of an RPM record in s, None while unknown.
    """

    record: Record
    count_s: float | None
    ticks_per_revolution: int


@dataclass(frozen=True, slots=True)
class RecordComes:
    """Notification that lines of a record are arriving.

    The board takes up to 1.3 s to send a record. It also sends a record for which the driver no
    longer waits.
    """


@dataclass(frozen=True, slots=True)
class RecordFailed(Unstamped):
    """Notification that a requested record will not come.

    ``reason``: the cause, and what to do.
    """

    reason: str


@dataclass(frozen=True, slots=True)
class TerminalLeft(Unstamped):
    """Notification that a terminal mode has ended.

    During the mode, the board does not report the e-stop button. So the state of the button may
    have changed.
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
