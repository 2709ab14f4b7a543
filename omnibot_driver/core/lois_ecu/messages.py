# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""All messages of the manual's table as values. ``codec`` turns them into lines and back.

The host sends ``Command``, the ECU sends ``Report``.

Sources: the ECU's manual, table of messages; the public firmware for 0x21 to 0x23.
"""

from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import Final

from omnibot_driver.core.readings import Unstamped

PERIOD_ONCE: Final = 0xFFFE
"""Value that is sent instead of a period in ms, so that the board sends the message only once."""
PERIOD_OFF: Final = 0xFFFF
MOST_SAMPLES: Final = 1024
"""Largest number of samples in a record. The board never completes a longer record."""

RECORD_END: Final = 0x00000000
HEADING_END: Final = 0x016A016A
HEADING_PADDING: Final = 0x016A
"""Value that the board appends to a heading record: 362 degrees, which is not a heading."""


class Code(IntEnum):
    """Command bytes that begin the protocol's lines."""

    DUTY = 0x01
    RPM = 0x02
    LED = 0x03
    RECORD_RPM = 0x04
    ESTOP_BUTTON = 0x05
    RECORD_HEADING = 0x0C
    GPS_POSITION = 0x0D
    GPS_TIME = 0x0E
    GPS_DATE = 0x0F
    HEADING = 0x10
    TERMINAL_MODE = 0x11
    TICKS = 0x12
    RECORD_TORQUE = 0x17
    RESET = 0x18
    DISTRIBUTE_BALL = 0x19
    ODOMETRY = 0x20


class Setting(IntEnum):
    """A float32 setting of the board, with its command byte.

    It can be written but not read back.
    """

    LEFT_KP = 0x06
    LEFT_TN = 0x07
    LEFT_TD = 0x08
    RIGHT_KP = 0x09
    RIGHT_TN = 0x0A
    RIGHT_TD = 0x0B
    LEFT_SHORT_CORRECTION = 0x13
    LEFT_LONG_CORRECTION = 0x14
    RIGHT_SHORT_CORRECTION = 0x15
    RIGHT_LONG_CORRECTION = 0x16
    LEFT_FEED_FORWARD = 0x21
    RIGHT_FEED_FORWARD = 0x22
    RPM_LOW_PASS = 0x23


class Stream(IntEnum):
    """A message that the ECU can send periodically, with its command byte."""

    GPS_POSITION = 0x0D
    GPS_TIME = 0x0E
    GPS_DATE = 0x0F
    HEADING = 0x10
    TICKS = 0x12
    ODOMETRY = 0x20


class TerminalMode(IntEnum):
    """What the serial line between the board and the host carries.

    * ``HOST``: the protocol.
    * ``HOST_WITHOUT_SUM``: the protocol, but lines from the host have no checksum.
    * Other modes: data of a device that is connected to the board.
    """

    HOST = 0
    GPS = 1
    COMPASS = 2
    VIRTUAL_COM = 3
    HOST_WITHOUT_SUM = 4


class RecordKind(Enum):
    """What the board records: times between ticks (RPM), motor torques or compass headings."""

    RPM = "rpm"
    TORQUE = "torque"
    HEADING = "heading"


# What the host sends


@dataclass(frozen=True, slots=True)
class SetDuty:
    """A command that sets the duty of each motor, in percent of the supply voltage: -100..100.

    The board does not control the speed (open loop).
    """

    left_percent: int
    right_percent: int


@dataclass(frozen=True, slots=True)
class SetRpm:
    """A command that sets the speed of each wheel in revolutions per minute.

    The board controls the speed (closed loop).
    """

    left_rpm: int
    right_rpm: int


@dataclass(frozen=True, slots=True)
class SetLed:
    """A command that switches the board's LED."""

    on: bool


@dataclass(frozen=True, slots=True)
class RecordRpm:
    """A command to record the times between each wheel's ticks, and then to send the record."""

    left_samples: int
    right_samples: int


@dataclass(frozen=True, slots=True)
class RecordTorque:
    """A command to record the torque of each motor, and then to send the record."""

    left_samples: int
    right_samples: int


@dataclass(frozen=True, slots=True)
class RecordHeading:
    """A command to record compass headings, and then to send the record."""

    samples: int


@dataclass(frozen=True, slots=True)
class WriteSetting:
    """A command that writes one of the board's float32 settings."""

    setting: Setting
    value: float


@dataclass(frozen=True, slots=True)
class SetPeriod:
    """A command that sets how often the board sends a message.

    ``period_ms``: 1 to 65533 ms, or ``PERIOD_ONCE``, or ``PERIOD_OFF``.
    """

    stream: Stream
    period_ms: int


@dataclass(frozen=True, slots=True)
class SetTerminalMode:
    """A command that sets the terminal mode, and whether lines from the host need a checksum."""

    mode: TerminalMode


@dataclass(frozen=True, slots=True)
class Reset:
    """A command that resets the board.

    According to the manual, it resets controllers, interfaces and counters. The public firmware
    resets only the tick counters.
    """


@dataclass(frozen=True, slots=True)
class DistributeBall:
    """A command that makes the ball distribution device drop one ball."""


Command = (
    SetDuty
    | SetRpm
    | SetLed
    | RecordRpm
    | RecordTorque
    | RecordHeading
    | WriteSetting
    | SetPeriod
    | SetTerminalMode
    | Reset
    | DistributeBall
)


# What the ECU sends


@dataclass(frozen=True, slots=True)
class EStopButton:
    """A press or release of the e-stop button.

    At both events, the board sets its set-points to zero.
    """

    pressed: bool


@dataclass(frozen=True, slots=True)
class GpsPosition:
    """The GPS position in degrees, north and east positive. Without a fix, both values are 0."""

    latitude_deg: float
    longitude_deg: float


@dataclass(frozen=True, slots=True)
class GpsTime:
    """The GPS time of day in UTC."""

    hours: int
    minutes: int
    seconds: int


@dataclass(frozen=True, slots=True)
class GpsDate:
    """The GPS date in UTC, with a year of two digits.

    While the date is unknown, all values are 0.
    """

    year: int
    month: int
    day: int


@dataclass(frozen=True, slots=True)
class Heading:
    """The compass heading in degrees clockwise from magnetic north, -180..359."""

    heading_deg: int


@dataclass(frozen=True, slots=True)
class Ticks:
    """Signed encoder ticks of both wheels since the board started or was reset.

    ``time_counts``: sending time by the board's clock, modulo 2³², in ns (manual) or ms (public
    firmware).
    """

    time_counts: int
    left: int
    right: int


@dataclass(frozen=True, slots=True)
class BoardOdometry:
    """The board's own pose and velocity of the robot, in a frame that is fixed to the floor.

    Velocities may be NaN or infinite. ``appended``: whether the command byte was 0x12, not 0x20.
    """

    x_m: float
    y_m: float
    yaw_rad: float
    dx_mps: float
    dy_mps: float
    yaw_rate_radps: float
    appended: bool = False


@dataclass(frozen=True, slots=True)
class Record:
    """A complete record with as many samples as were requested.

    ``left``, ``right``: samples by wheel.

    * RPM: times between encoder ticks, in the unit ``record_request.COUNT_S``.
    * Torque: 12-bit values.
    * Headings: degrees, all in ``left``.
    """

    kind: RecordKind
    left: tuple[int, ...]
    right: tuple[int, ...]

    @property
    def lines(self) -> int:
        """Number of lines of the record. Each line has two values; the last line marks the end."""
        values = len(self.left) + 1 if self.kind is RecordKind.HEADING else 2 * len(self.left)
        return values // 2 + 1


@dataclass(frozen=True, slots=True)
class LostRecord:
    """A record that was discarded, because it was damaged or not requested.

    ``lines``: number of its lines that arrived.
    """

    lines: int


@dataclass(frozen=True, slots=True)
class TerminalLine(Unstamped):
    """A line of text from a sensor, which the board passes on in a terminal mode."""

    text: str


Report = (
    EStopButton
    | GpsPosition
    | GpsTime
    | GpsDate
    | Heading
    | Ticks
    | BoardOdometry
    | Record
    | LostRecord
    | TerminalLine
)
