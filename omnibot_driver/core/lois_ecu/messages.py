# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Every message of the manual's table as a value, and its lines.

Source: the ECU's manual, table of messages; for the order of words within a payload and for 0x21 to
0x23 the public firmware. What the host sends is a ``Command``, what the ECU sends a ``Report``;
some command bytes are both. Units are in the names; what a count means in SI units is known
elsewhere.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import Final

from omnibot_driver.core.errors import FrameError
from omnibot_driver.core.lois_ecu.lines import (
    MARKER,
    Line,
    encode_line,
    from_float,
    from_pair,
    line_of,
    signed_pair,
    to_float,
    unsigned_pair,
)

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
    """What can be recorded."""

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
    """Record so many tick times of each wheel, then send them."""

    left_samples: int
    right_samples: int


@dataclass(frozen=True, slots=True)
class RecordTorque:
    """Record so many torque readings of each motor, then send them."""

    left_samples: int
    right_samples: int


@dataclass(frozen=True, slots=True)
class RecordHeading:
    """Record so many compass headings, then send them."""

    samples: int


@dataclass(frozen=True, slots=True)
class WriteSetting:
    """One float32."""

    setting: Setting
    value: float


@dataclass(frozen=True, slots=True)
class SetPeriod:
    """``period_ms`` below ``PERIOD_ONCE``, or that, or ``PERIOD_OFF``."""

    stream: Stream
    period_ms: int


@dataclass(frozen=True, slots=True)
class SetTerminalMode:
    """Also turns the check of what the host sends on or off."""

    mode: TerminalMode


@dataclass(frozen=True, slots=True)
class Reset:
    """By the manual all controllers, interfaces and counters; in the firmware the ticks alone."""


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


def encode_command(command: Command, *, with_sum: bool = True) -> bytes:
    """The one line that says it. Raises FrameError when a value does not fit or is no period."""
    code, payload = _said(command)
    return encode_line(code, payload, with_sum=with_sum)


def _said(command: Command) -> tuple[int, int]:
    match command:
        case SetDuty(left, right):
            return Code.DUTY, _words(left, right)
        case SetRpm(left, right):
            return Code.RPM, _words(left, right)
        case SetLed(on):
            return Code.LED, int(on)
        case RecordRpm(left, right):
            return Code.RECORD_RPM, _samples(left) << 16 | _samples(right)
        case RecordTorque(left, right):
            return Code.RECORD_TORQUE, _samples(left) << 16 | _samples(right)
        case RecordHeading(samples):
            return Code.RECORD_HEADING, _samples(samples)
        case WriteSetting(setting, number):
            return setting, from_float(number)
        case SetPeriod(stream, period_ms):
            if not 0 < period_ms <= PERIOD_OFF:
                raise FrameError(f"{period_ms} ms is no period: 1 to 65533, 0xfffe or 0xffff")
            return stream, period_ms
        case SetTerminalMode(mode):
            return Code.TERMINAL_MODE, mode
        case Reset():
            return Code.RESET, 0
        case DistributeBall():
            return Code.DISTRIBUTE_BALL, 0


def _words(left: int, right: int) -> int:
    if not (-0x8000 <= left <= 0x7FFF and -0x8000 <= right <= 0x7FFF):
        raise FrameError(f"{left} and {right} do not fit two signed words of 16 bits")
    return from_pair(left, right)


def _samples(count: int) -> int:
    if not 0 <= count <= MOST_SAMPLES:
        raise FrameError(f"{count} samples cannot be recorded: 0 to {MOST_SAMPLES}")
    return count


def decode_command(data: bytes, *, with_sum: bool = True) -> Command:
    """What the one line of a host says. Raises FrameError when it says nothing."""
    line = line_of(data, sum_required=with_sum)
    if line is None or (not with_sum and len(data.replace(b"\r", b"")) != 12):
        raise FrameError(f"not one whole line: {data!r}")
    made = _COMMANDS.get(line.command)
    try:
        if made is not None:
            return made(line.payload)
        if line.command in Setting.__members__.values():
            return WriteSetting(Setting(line.command), to_float(line.payload))
        if line.command in Stream.__members__.values():
            return SetPeriod(Stream(line.command), line.payload & 0xFFFF)
    except ValueError as error:
        raise FrameError(f"no value of this command: {data!r}") from error
    raise FrameError(f"no command that a host sends: {data!r}")


_COMMANDS: Final[dict[int, Callable[[int], Command]]] = {
    Code.DUTY: lambda payload: SetDuty(*signed_pair(payload)),
    Code.RPM: lambda payload: SetRpm(*signed_pair(payload)),
    Code.LED: lambda payload: SetLed(payload & 0xFFFF != 0),
    Code.RECORD_RPM: lambda payload: RecordRpm(*unsigned_pair(payload)),
    Code.RECORD_TORQUE: lambda payload: RecordTorque(*unsigned_pair(payload)),
    Code.RECORD_HEADING: RecordHeading,
    Code.TERMINAL_MODE: lambda payload: SetTerminalMode(TerminalMode(payload & 0xFF)),
    Code.RESET: lambda _: Reset(),
    Code.DISTRIBUTE_BALL: lambda _: DistributeBall(),
}


def encode_report(report: Report) -> bytes:
    """All lines of one report, as the board sends it. Raises FrameError when a value is too big."""
    match report:
        case EStopButton(pressed):
            return encode_line(Code.ESTOP_BUTTON, int(pressed))
        case GpsPosition(latitude, longitude):
            return _group(Code.GPS_POSITION, [from_float(latitude), from_float(longitude)])
        case GpsTime(hours, minutes, seconds):
            return encode_line(Code.GPS_TIME, hours << 16 | minutes << 8 | seconds)
        case GpsDate(year, month, day):
            return encode_line(Code.GPS_DATE, year << 16 | month << 8 | day)
        case Heading(heading_deg):
            return encode_line(Code.HEADING, heading_deg & 0xFFFF)
        case Ticks(time_counts, left, right):
            return _group(Code.TICKS, [time_counts, left & MARKER, right & MARKER])
        case BoardOdometry():
            code = Code.TICKS if report.appended else Code.ODOMETRY
            numbers = (
                *(report.x_m, report.y_m, report.yaw_rad),
                *(report.dx_mps, report.dy_mps, report.yaw_rate_radps),
            )
            return _group(code, [from_float(number) for number in numbers])
        case Record():
            return _encode_record(report)
        case TerminalLine(text):
            return text.encode("latin-1") + b"\r\n"


def _group(code: int, payloads: list[int]) -> bytes:
    return b"".join(encode_line(code, payload) for payload in (MARKER, *payloads))


def _encode_record(record: Record) -> bytes:
    if record.kind is RecordKind.HEADING:
        padded = (*record.left, HEADING_PADDING) if len(record.left) % 2 else record.left
        pairs = zip(padded[::2], padded[1::2], strict=True)
        payloads = [from_pair(first, second) for first, second in pairs]
        return b"".join(
            encode_line(Code.RECORD_HEADING, payload) for payload in (*payloads, HEADING_END)
        )
    code = Code.RECORD_RPM if record.kind is RecordKind.RPM else Code.RECORD_TORQUE
    longest = max(len(record.left), len(record.right))
    left, right = ((*one, *[10] * (longest - len(one))) for one in (record.left, record.right))
    payloads = [from_pair(*pair) for pair in zip(left, right, strict=True)]
    return b"".join(encode_line(code, payload) for payload in (*payloads, RECORD_END))


def single_report(line: Line) -> Report | None:
    """What a line reports that is a report by itself; None if it reports nothing, or nonsense."""
    payload = line.payload
    low = payload & 0xFFFF
    high, middle, last = payload >> 16, low >> 8, low & 0xFF
    match line.command:
        case Code.ESTOP_BUTTON if payload <= 1:
            return EStopButton(payload == 1)
        case Code.GPS_TIME if high < 24 and middle < 60 and last <= 60:
            return GpsTime(high, middle, last)
        case Code.GPS_DATE if high < 100 and middle <= 12 and last <= 31:
            return GpsDate(high, middle, last)
        case Code.HEADING if payload <= 0xFFFF and -180 <= signed_pair(payload)[1] < 360:
            return Heading(signed_pair(payload)[1])
    return None
