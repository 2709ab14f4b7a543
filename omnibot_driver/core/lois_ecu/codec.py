# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Encoding of all messages as lines, and decoding of commands and of one-line reports.

Sources: the ECU's manual; for the order of words in a payload, the public firmware.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

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
from omnibot_driver.core.lois_ecu.messages import (
    HEADING_END,
    HEADING_PADDING,
    MOST_SAMPLES,
    PERIOD_OFF,
    RECORD_END,
    BoardOdometry,
    Code,
    Command,
    DistributeBall,
    EStopButton,
    GpsDate,
    GpsPosition,
    GpsTime,
    Heading,
    LostRecord,
    Record,
    RecordHeading,
    RecordKind,
    RecordRpm,
    RecordTorque,
    Report,
    Reset,
    SetDuty,
    SetLed,
    SetPeriod,
    SetRpm,
    SetTerminalMode,
    Setting,
    Stream,
    TerminalLine,
    TerminalMode,
    Ticks,
    WriteSetting,
)


@dataclass(frozen=True, slots=True)
class Form:
    """One kind of command, with its command byte and class.

    * ``payload``: converts the fields of a command to a payload.
    * ``command``: converts a payload to a command.
    """

    code: Code
    kind: type
    payload: Callable[..., int]
    command: Callable[[int], Command]


def _words(left: int, right: int) -> int:
    if not (-0x8000 <= left <= 0x7FFF and -0x8000 <= right <= 0x7FFF):
        raise FrameError(f"{left} and {right} do not fit into two signed 16-bit words")
    return from_pair(left, right)


def _samples(*counts: int) -> int:
    for count in counts:
        if not 0 <= count <= MOST_SAMPLES:
            raise FrameError(f"{count} samples cannot be recorded, only 0 to {MOST_SAMPLES}")
    return counts[0] << 16 | counts[1] if len(counts) == 2 else counts[0]


_FORMS: Final = (
    Form(Code.DUTY, SetDuty, _words, lambda payload: SetDuty(*signed_pair(payload))),
    Form(Code.RPM, SetRpm, _words, lambda payload: SetRpm(*signed_pair(payload))),
    Form(Code.LED, SetLed, int, lambda payload: SetLed(payload & 0xFFFF != 0)),
    Form(Code.RECORD_RPM, RecordRpm, _samples, lambda payload: RecordRpm(*unsigned_pair(payload))),
    Form(
        Code.RECORD_TORQUE,
        RecordTorque,
        _samples,
        lambda payload: RecordTorque(*unsigned_pair(payload)),
    ),
    Form(Code.RECORD_HEADING, RecordHeading, _samples, RecordHeading),
    Form(
        Code.TERMINAL_MODE,
        SetTerminalMode,
        int,
        lambda payload: SetTerminalMode(TerminalMode(payload & 0xFF)),
    ),
    Form(Code.RESET, Reset, lambda: 0, lambda _: Reset()),
    Form(Code.DISTRIBUTE_BALL, DistributeBall, lambda: 0, lambda _: DistributeBall()),
)
_BY_KIND: Final = {form.kind: form for form in _FORMS}
_BY_CODE: Final[dict[int, Form]] = {form.code: form for form in _FORMS}


def encode_command(command: Command, *, with_sum: bool = True) -> bytes:
    """Return the line that encodes ``command``. Raises FrameError for a value out of range."""
    code, payload = _said(command)
    return encode_line(code, payload, with_sum=with_sum)


def _said(command: Command) -> tuple[int, int]:
    match command:
        case WriteSetting(setting, number):
            return setting, from_float(number)
        case SetPeriod(stream, period_ms):
            if not 0 < period_ms <= PERIOD_OFF:
                raise FrameError(
                    f"a period of {period_ms} ms is not possible: it must be 1 to"
                    " 65533, 0xfffe (once) or 0xffff (off)"
                )
            return stream, period_ms
    form = _BY_KIND[type(command)]
    fields: Any = (getattr(command, name) for name in command.__match_args__)
    return form.code, form.payload(*fields)


def decode_command(data: bytes, *, with_sum: bool = True) -> Command:
    """Decode one line from a host. Raises FrameError if the line is not a command."""
    line = line_of(data, sum_required=with_sum)
    if line is None or (not with_sum and len(data.replace(b"\r", b"")) != 12):
        raise FrameError(f"not exactly one line: {data!r}")
    form = _BY_CODE.get(line.command)
    try:
        if form is not None:
            return form.command(line.payload)
        if line.command in Setting.__members__.values():
            return WriteSetting(Setting(line.command), to_float(line.payload))
        if line.command in Stream.__members__.values():
            return SetPeriod(Stream(line.command), line.payload & 0xFFFF)
    except ValueError as error:
        raise FrameError(f"not a valid value for this command: {data!r}") from error
    raise FrameError(f"not a command that a host sends: {data!r}")


def encode_report(report: Report) -> bytes:
    """Return the lines with which a board sends ``report``.

    Raises FrameError if a value is too big.
    """
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
        case LostRecord():
            raise FrameError("a record whose samples are lost (LostRecord) cannot be encoded")
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
    """Return the report that ``line`` contains.

    Return None if the report has more than one line, if ``line`` is not a report, or if a value is
    impossible.
    """
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
