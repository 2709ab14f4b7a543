# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Every message of the manual's table is compared with lines typed by hand."""

import math
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnibot_driver.core.errors import FrameError
from omnibot_driver.core.lois_ecu import (
    PERIOD_OFF,
    PERIOD_ONCE,
    BoardOdometry,
    DistributeBall,
    EStopButton,
    GpsDate,
    GpsPosition,
    GpsTime,
    Heading,
    LoisDecoder,
    Record,
    RecordHeading,
    RecordKind,
    RecordRpm,
    RecordTorque,
    Reset,
    SetDuty,
    SetLed,
    SetPeriod,
    SetRpm,
    SetTerminalMode,
    Setting,
    Stream,
    TerminalMode,
    Ticks,
    WriteSetting,
    decode_command,
    encode_command,
    encode_report,
)
from omnibot_driver.core.lois_ecu.messages import Command, Report

COMMANDS: list[tuple[bytes, Command]] = [
    (b":01003200323b\n", SetDuty(50, 50)),
    (b":01ff9c006463\n", SetDuty(-100, 100)),
    (b":020000000038\n", SetRpm(0, 0)),
    (b":020014001438\n", SetRpm(20, 20)),
    (b":020014ffec3b\n", SetRpm(20, -20)),
    (b":030000000138\n", SetLed(True)),
    (b":04006400643e\n", RecordRpm(100, 100)),
    (b":063f2106256b\n", WriteSetting(Setting.LEFT_KP, 0.629)),
    (b":0a3f80000036\n", WriteSetting(Setting.RIGHT_TN, 1.0)),
    (b":0c000000036a\n", RecordHeading(3)),
    (b":0d0000fffe6d\n", SetPeriod(Stream.GPS_POSITION, PERIOD_ONCE)),
    (b":0f0000ffff6c\n", SetPeriod(Stream.GPS_DATE, PERIOD_OFF)),
    (b":120000fffe3a\n", SetPeriod(Stream.TICKS, PERIOD_ONCE)),
    (b":11000000043e\n", SetTerminalMode(TerminalMode.HOST_WITHOUT_SUM)),
    (b":11000000013b\n", SetTerminalMode(TerminalMode.GPS)),
    (b":170064000a6f\n", RecordTorque(100, 10)),
    (b":180000000033\n", Reset()),
    (b":190000000032\n", DistributeBall()),
    (b":21400000003d\n", WriteSetting(Setting.LEFT_FEED_FORWARD, 2.0)),
    (b":22400000003e\n", WriteSetting(Setting.RIGHT_FEED_FORWARD, 2.0)),
    (b":233f80000066\n", WriteSetting(Setting.RPM_LOW_PASS, 1.0)),
]

REPORTS: list[tuple[bytes, Report]] = [
    (b":05000000013e\n", EStopButton(True)),
    (b":05000000003f\n", EStopButton(False)),
    (b":0dffffffff6e\n:0d424000006c\n:0d414000006f\n", GpsPosition(48.0, 12.0)),
    (b":0e00173b3b69\n", GpsTime(23, 59, 59)),
    (b":0f001a0b1669\n", GpsDate(26, 11, 22)),
    (b":100000ffa66c\n", Heading(-90)),
    (b":100000005a6f\n", Heading(90)),
    (b":12ffffffff39\n:120000019031\n:120000000a68\n:120000000930\n", Ticks(400, 10, 9)),
    (
        b":20ffffffff38\n:203f0000006d\n:20be80000037\n:203f80000065\n:203f0000006d\n"
        b":200000000038\n:203f80000065\n",
        BoardOdometry(0.5, -0.25, 1.0, 0.5, 0.0, 1.0),
    ),
]


def in_capitals(lines: bytes) -> bytes:
    """Return the lines in upper case, with checksums of the upper-case characters."""
    said = b""
    for line in lines.upper().splitlines():
        total = 0
        for character in line[:11]:
            total ^= character
        said += b"%s%02X\n" % (line[:11], total)
    return said


def sum_in_capitals(lines: bytes) -> bytes:
    """Return the lines with only their checksums in upper case."""
    return b"".join(line[:11] + line[11:].upper() + b"\n" for line in lines.splitlines())


@pytest.mark.parametrize(("line", "command"), COMMANDS, ids=lambda value: str(value)[:32])
def test_a_command_is_its_line_both_ways(line: bytes, command: Command) -> None:
    """Each command is encoded to the manual's line, and the line is decoded to the command.

    Upper case and a carriage return are accepted.
    """
    assert encode_command(command) == line
    for form in (line, in_capitals(line), sum_in_capitals(line), line[:-1] + b"\r\n"):
        decoded = decode_command(form)
        if isinstance(command, WriteSetting) and isinstance(decoded, WriteSetting):
            assert decoded.setting is command.setting
            assert decoded.value == pytest.approx(command.value, rel=1e-7)
        else:
            assert decoded == command


@pytest.mark.parametrize(("line", "command"), COMMANDS, ids=lambda value: str(value)[:32])
def test_a_command_without_checksum_is_two_characters_shorter(
    line: bytes, command: Command
) -> None:
    """After command 0x11 with value 4, the board expects lines without a checksum.

    The encoder then omits the checksum, which has two characters, and the decoder does not expect
    it.
    """
    short = line[:11] + b"\n"
    assert encode_command(command, with_sum=False) == short
    assert type(decode_command(short, with_sum=False)) is type(command)
    with pytest.raises(FrameError):
        decode_command(short)


@pytest.mark.parametrize(("lines", "report"), REPORTS, ids=lambda value: str(value)[:32])
def test_a_report_is_its_lines_both_ways(lines: bytes, report: Report) -> None:
    """Each report is encoded to the manual's lines, and the lines are decoded to the report.

    Upper case and a carriage return are accepted.
    """
    assert encode_report(report) == lines
    for form in (lines, in_capitals(lines), sum_in_capitals(lines), lines.replace(b"\n", b"\r\n")):
        decoder = LoisDecoder()
        assert decoder.feed(form, 0.0) + decoder.feed(b"", 0.1) == [report]
        assert decoder.group_statistics.damaged_groups == decoder.statistics.faults == 0


def test_odometry_behind_ticks_is_told_by_its_length() -> None:
    """Message 0x12 of the public firmware contains ticks (3 lines) or odometry (6 lines).

    The decoder distinguishes them by the number of lines.
    """
    decoder = LoisDecoder()
    ticks = b":12ffffffff39\n:120000019031\n:120000000a68\n:120000000930\n"
    odometry = encode_report(BoardOdometry(0.5, 0.25, 0.125, 0.0, 0.0, 0.0, appended=True))
    assert odometry.startswith(b":12ffffffff39\n")
    assert decoder.feed(ticks + odometry, 0.0) + decoder.flush(0.1) == [
        Ticks(400, 10, 9),
        BoardOdometry(0.5, 0.25, 0.125, 0.0, 0.0, 0.0, appended=True),
    ]


def test_a_velocity_that_is_not_a_number_is_reported_as_such() -> None:
    """A report has NaN or infinity as velocity.

    The decoder passes it on, and the pose stays valid.
    """
    decoder = LoisDecoder()
    lines = encode_report(BoardOdometry(1.0, 2.0, 3.0, math.nan, math.inf, -math.inf))
    (report,) = decoder.feed(lines, 0.0) + decoder.flush(0.0)
    assert isinstance(report, BoardOdometry)
    assert (report.x_m, report.y_m, report.yaw_rad) == (1.0, 2.0, 3.0)
    assert math.isnan(report.dx_mps)
    assert (report.dy_mps, report.yaw_rate_radps) == (math.inf, -math.inf)


def test_a_record_of_tick_times_ends_with_zeros() -> None:
    """A record of tick times ends with zeros. Before them, the shorter channel is padded with 10.

    The decoder removes the zeros and the padding.
    """
    decoder = LoisDecoder()
    decoder.expect_record(RecordKind.RPM, 2, 1)
    data = b":04000a000b3d\n" + encode_report(Record(RecordKind.RPM, (10, 12), (11,)))[14:]
    assert data.endswith(b":04000000003e\n")
    assert decoder.feed(data, 0.0) == [Record(RecordKind.RPM, (10, 12), (11,))]


def test_a_record_of_torque_may_come_under_the_number_of_the_tick_times() -> None:
    """The public firmware sends a torque record (0x17) with 0x04, the command byte of tick times.

    The decoder accepts a torque record with either command byte.
    """
    for code in (b"04", b"17"):
        decoder = LoisDecoder()
        decoder.expect_record(RecordKind.TORQUE, 1, 1)
        sums = {b"04": (b"3d", b"3e"), b"17": (b"3f", b"3c")}[code]
        data = b":%s000a000b%s\n:%s00000000%s\n" % (code, sums[0], code, sums[1])
        assert decoder.feed(data, 0.0) == [Record(RecordKind.TORQUE, (10,), (11,))]


def test_a_record_of_headings_is_padded_with_362_degrees() -> None:
    """After the last sample of a record of headings, the board sends two values of 362°.

    It sends a third one if the number of values would otherwise be odd.
    """
    decoder = LoisDecoder()
    decoder.expect_record(RecordKind.HEADING, 3)
    data = b":0c0005fffb68\n:0c0003016a3c\n:0c016a016a69\n"
    record = Record(RecordKind.HEADING, (5, -5, 3), ())
    assert decoder.feed(data, 0.0) == [record]
    assert encode_report(record) == data


@pytest.mark.parametrize(
    "command",
    [
        SetRpm(40000, 0),
        SetDuty(0, -40000),
        RecordRpm(1025, 0),
        RecordHeading(1025),
        SetPeriod(Stream.HEADING, 0),
        SetPeriod(Stream.TICKS, 65536),
        WriteSetting(Setting.LEFT_KP, 1e39),
    ],
    ids=str,
)
def test_a_command_that_does_not_fit_is_refused(command: Command) -> None:
    """The encoder rejects values out of range.

    An example is a period of 0: the board would send all the time, and so could not receive.
    """
    with pytest.raises(FrameError):
        encode_command(command)


@given(st.binary(max_size=20))
def test_what_is_not_a_line_is_refused_by_name(data: bytes) -> None:
    """``decode_command`` gets any bytes, and returns a command or raises FrameError.

    No other exception is raised.
    """
    with suppress(FrameError):
        decode_command(data)
