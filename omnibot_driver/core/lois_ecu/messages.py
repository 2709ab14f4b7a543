# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Every message of the manual's table as a value. How it is written in lines is in ``codec``.

Source: the ECU's manual, table of messages; for 0x21 to 0x23 the public firmware. What the host
sends is a ``Command``, what the ECU sends a ``Report``; some command bytes are both. Units are in
the names; what a count means in SI units is known elsewhere.
"""

from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import Final

PERIOD_ONCE: Final = 0xFFFE
"""Instead of a period in ms: send the message once, then never."""
PERIOD_OFF: Final = 0xFFFF
MOST_SAMPLES: Final = 1024
"""A record of more never completes."""

RECORD_END: Final = 0x00000000
HEADING_END: Final = 0x016A016A
HEADING_PADDING: Final = 0x016A
"""362 degrees, which no heading is."""


class Code(IntEnum):
    """The command byte."""

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
    """A float32 that can be written and not read back; the value is its command byte."""

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
    """A message that the ECU sends periodically; the value is its command byte."""

    GPS_POSITION = 0x0D
    GPS_TIME = 0x0E
    GPS_DATE = 0x0F
    HEADING = 0x10
    TICKS = 0x12
    ODOMETRY = 0x20


class TerminalMode(IntEnum):
    """``HOST`` is the protocol; the others pass a serial input through and silence the protocol.

    ``HOST_WITHOUT_SUM``: the protocol, and what the host sends has no checksum.
    """

    HOST = 0
    GPS = 1
    COMPASS = 2
    VIRTUAL_COM = 3
    HOST_WITHOUT_SUM = 4


class RecordKind(Enum):
    """The kinds of records."""

    RPM = "rpm"
    TORQUE = "torque"
    HEADING = "heading"


# What the host sends


@dataclass(frozen=True, slots=True)
class SetDuty:
    """Open loop: percent of the supply for each motor, -100..100."""

    left_percent: int
    right_percent: int


@dataclass(frozen=True, slots=True)
class SetRpm:
    """Closed loop: revolutions of each wheel per minute."""

    left_rpm: int
    right_rpm: int


@dataclass(frozen=True, slots=True)
class SetLed:
    """The board's LED."""

    on: bool


@dataclass(frozen=True, slots=True)
class RecordRpm:
    """Record this many tick times of each wheel, then send them."""

    left_samples: int
    right_samples: int


@dataclass(frozen=True, slots=True)
class RecordTorque:
    """Record this many torque readings of each motor, then send them."""

    left_samples: int
    right_samples: int


@dataclass(frozen=True, slots=True)
class RecordHeading:
    """Record this many compass headings, then send them."""

    samples: int


@dataclass(frozen=True, slots=True)
class WriteSetting:
    """A command that writes a setting, one float32."""

    setting: Setting
    value: float


@dataclass(frozen=True, slots=True)
class SetPeriod:
    """``period_ms`` below ``PERIOD_ONCE``, or that, or ``PERIOD_OFF``."""

    stream: Stream
    period_ms: int


@dataclass(frozen=True, slots=True)
class SetTerminalMode:
    """A command that sets the terminal mode, and the check of the host's lines."""

    mode: TerminalMode


@dataclass(frozen=True, slots=True)
class Reset:
    """A command that resets.

    The manual: controllers, interfaces and counters; the firmware: ticks.
    """


@dataclass(frozen=True, slots=True)
class DistributeBall:
    """Use the ball distribution device once."""


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
    """The emergency stop button was pressed or released; either sets both set-points to zero."""

    pressed: bool


@dataclass(frozen=True, slots=True)
class GpsPosition:
    """Degrees, north and east positive; 0/0 where there is no fix."""

    latitude_deg: float
    longitude_deg: float


@dataclass(frozen=True, slots=True)
class GpsTime:
    """UTC."""

    hours: int
    minutes: int
    seconds: int


@dataclass(frozen=True, slots=True)
class GpsDate:
    """UTC, the year of the century; zeros while unknown."""

    year: int
    month: int
    day: int


@dataclass(frozen=True, slots=True)
class Heading:
    """Degrees to magnetic north, clockwise, -180..180."""

    heading_deg: int


@dataclass(frozen=True, slots=True)
class Ticks:
    """Encoder ticks since the board began or was reset, and its clock as it was sent.

    ``time_counts``: ns by the manual, ms in the firmware; wraps at 2³². Ticks are signed.
    """

    time_counts: int
    left: int
    right: int


@dataclass(frozen=True, slots=True)
class BoardOdometry:
    """The board's own dead reckoning; velocities in its earth frame, may be NaN or infinite.

    ``appended``: it came behind a Ticks group, under that group's command byte.
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
    """As recorded, left and right as long as was asked for; a heading record has no right.

    RPM: time of a tick in the board's unit (see Ticks of the docs); torque: 12 bit of an ADC;
    heading: degrees.
    """

    kind: RecordKind
    left: tuple[int, ...]
    right: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class TerminalLine:
    """A line of a serial input that is passed through."""

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
    | TerminalLine
)
