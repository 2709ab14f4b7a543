# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the LOIS decoder on undamaged and damaged streams.

A *group* is the lines of one report.
"""

import itertools
from random import Random

import pytest
from lois_streams import Piece, decoded, pieces, reports

from omnibot_driver.core.lois_ecu import (
    BoardOdometry,
    EStopButton,
    GpsPosition,
    Heading,
    LoisDecoder,
    LostRecord,
    Record,
    RecordKind,
    TerminalLine,
    Ticks,
    encode_report,
)
from omnibot_driver.core.lois_ecu.messages import Report

ODOMETRY = [
    BoardOdometry(0.1 * n, 0.2 * n, 0.3 * n, 0.25, 0.5, 0.75) for n in (1.25, 2.5, 3.75, 5.0)
]
TICKS = [Ticks(1000 + 400 * n, 10 * n + 7, 11 * n + 3) for n in range(4)]
FIXES = [GpsPosition(48.0 + n, 12.0 + n) for n in range(4)]
GROUPS: dict[str, list[Report]] = {"0x20": [*ODOMETRY], "0x12": [*TICKS], "0x0d": [*FIXES]}


def rounded(found: list[Report]) -> list[bytes]:
    """Return the reports as lines with rounded floats, so that rounding errors do not matter."""
    return [encode_report(report) for report in found]


@pytest.mark.parametrize("firmware", [True, False], ids=["firmware", "documented"])
def test_an_undamaged_stream_is_decoded_whole_in_any_chunks(firmware: bool) -> None:
    """A stream is decoded in one piece, byte by byte or cut at random places.

    The reports are the same.
    """
    said = reports(20.0, firmware=firmware)
    sent = [report for _, report in said]
    stream = pieces(said)
    assert decoded(stream)[0] == sent
    assert decoded([(at, bytes([byte])) for at, data in stream for byte in data])[0] == sent
    random = Random(5)
    for _ in range(5):
        cut: list[Piece] = []
        for at, data in stream:
            middle = random.randrange(len(data))
            cut += [(at, data[:middle]), (at, data[middle:])]
        found, decoder = decoded(cut)
        assert found == sent
        assert decoder.statistics.faults == decoder.group_statistics.damaged_groups == 0


def test_a_group_comes_out_with_its_last_byte_where_nothing_speaks_against_it() -> None:
    """The decoder returns a plausible group of lines as soon as its last byte arrives.

    Exception: the first group of each kind waits for the next line or for a silence.
    """
    decoder = LoisDecoder()
    for at, (ticks, odometry) in enumerate(zip(TICKS, ODOMETRY, strict=True)):
        for group in (odometry, ticks):
            data = encode_report(group)
            found = decoder.feed(data[:-1], float(at))
            assert at < 2 or not found
            found = decoder.feed(data[-1:], float(at))
            assert rounded(found) == ([data] if at else [])
            if not at:
                assert decoder.feed(b"", 0.1) == [group]


def test_a_group_whose_lines_are_alike_waits_for_what_follows_or_for_silence() -> None:
    """A group that ends with two equal lines waits for the next line or for 50 ms of silence.

    The second line may be a copy of the first.
    """
    alike = encode_report(Ticks(1000, 5, 5))
    decoder = LoisDecoder()
    assert decoder.feed(encode_report(Ticks(600, 4, 3)), 0.0) == []
    assert decoder.feed(b"", 0.04) == []
    assert decoder.feed(b"", 0.06) == [Ticks(600, 4, 3)]
    assert decoder.feed(encode_report(Heading(2)), 0.07) == [Heading(2)]
    assert decoder.feed(alike, 0.4) == []
    assert decoder.resolves_at == pytest.approx(0.45)
    assert decoder.feed(encode_report(Heading(3)), 0.41) == [Ticks(1000, 5, 5), Heading(3)]
    assert decoder.times == [0.4, 0.41]
    assert decoder.resolves_at == float("inf")


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        *itertools.product(GROUPS, ["lost", "doubled", "foreign", "cut"]),
        ("0x12", "foreign of its kind"),
        ("0x0d", "foreign of its kind"),
    ],
)
def test_a_damaged_group_is_dropped_whole_and_the_next_is_whole(name: str, damage: str) -> None:
    """The decoder drops a group in which one line is damaged, and returns the next group.

    Exception: a group whose last line arrives twice is returned, unless it is a GPS fix.
    """
    groups = GROUPS[name]
    whole = [encode_report(group) for group in groups]
    lines = whole[2].splitlines(keepends=True)
    foreign = encode_report(EStopButton(True))
    if damage == "foreign of its kind":
        foreign = encode_report(groups[0]).splitlines(keepends=True)[1]
    for at in range(1, len(lines)):
        harmed = list(lines)
        if damage == "lost":
            del harmed[at]
        elif damage == "doubled":
            harmed.insert(at, harmed[at])
        elif damage == "cut":
            harmed[at] = harmed[at][:5] + harmed[at][6:]
        else:
            harmed.insert(at, foreign)
        decoder = LoisDecoder()
        found: list[Report] = []
        for step, data in enumerate([whole[0], whole[1], b"".join(harmed), whole[3]]):
            found += decoder.feed(data, 0.4 * step)
        found += decoder.flush(2.0)
        found = [report for report in found if not isinstance(report, EStopButton)]
        came_before = damage == "doubled" and at == len(lines) - 1 and name != "0x0d"
        assert rounded(found) == [*whole[: 3 if came_before else 2], whole[3]], at
        statistics = decoder.group_statistics
        assert statistics.damaged_groups + statistics.implausible >= 1


def test_a_doubled_marker_costs_nothing() -> None:
    """The marker line of a group arrives twice. The first marker counts as a damaged, empty group.

    The group after the second marker is returned.
    """
    marker, *values = encode_report(TICKS[0]).splitlines(keepends=True)
    decoder = LoisDecoder()
    found = decoder.feed(marker + marker + b"".join(values), 0.0) + decoder.flush(0.0)
    assert found == [TICKS[0]]
    assert decoder.group_statistics.damaged_groups == 1


@pytest.mark.parametrize("lost", range(11))
def test_ticks_with_odometry_behind_them_survive_any_lost_line(lost: int) -> None:
    """A tick report and an odometry report come together, and one text line is lost.

    The decoder returns the complete report, although both reports have the same command byte.
    """
    decoder = LoisDecoder()
    found: list[Report] = []
    sent: list[bytes] = []
    for step, (ticks, odometry) in enumerate(zip(TICKS, ODOMETRY, strict=True)):
        pose = (odometry.x_m, odometry.y_m, odometry.yaw_rad)
        appended = BoardOdometry(*pose, 0.5, 0.25, 0.125, appended=True)
        lines = (encode_report(ticks) + encode_report(appended)).splitlines(keepends=True)
        sent += [encode_report(ticks), encode_report(appended)]
        if step == 2:
            del lines[lost]
        found += decoder.feed(b"".join(lines), 0.4 * step)
    found += decoder.flush(2.0)
    missing = [said for said in sent if said not in rounded(found)]
    assert all(said in sent for said in rounded(found))
    assert missing == ([sent[4]] if lost < 4 else [sent[5]])


@pytest.mark.parametrize("kind", RecordKind)
def test_a_damaged_record_is_dropped_whole_and_the_next_is_whole(kind: RecordKind) -> None:
    """The decoder drops a damaged record completely, and decodes the next record.

    A line of the damaged record is lost, doubled, cut or foreign.
    """
    samples = tuple(range(20, 31))
    record = Record(kind, samples, () if kind is RecordKind.HEADING else samples[:5])
    whole = encode_report(record)
    lines = whole.splitlines(keepends=True)
    for at in range(len(lines)):
        for harmed in (
            lines[:at] + lines[at + 1 :],
            lines[: at + 1] + lines[at:],
            [*lines[:at], lines[at][1:], *lines[at + 1 :]],
            [*lines[:at], encode_report(Heading(1)), *lines[at:]],
        ):
            decoder = LoisDecoder()
            decoder.expect_record(kind, len(record.left), len(record.right))
            found = decoder.feed(b"".join(harmed), 0.0)
            decoder.expect_record(kind, len(record.left), len(record.right))
            again = decoder.feed(whole, 1.0)
            found = [report for report in found if isinstance(report, Record)]
            if at == len(lines) - 1 and harmed == lines[: at + 1] + lines[at:]:
                assert found == [record]  # its end came twice, so it is complete
            elif found:
                assert found == [record]  # the foreign line came before it
                assert at == 0
            assert again == [record]


def test_a_record_that_was_not_asked_for_is_dropped() -> None:
    """The decoder discards a record that was not requested, and reports how many lines it had.

    Only for a requested record can the decoder detect that lines are lost.
    """
    decoder = LoisDecoder()
    record = encode_report(Record(RecordKind.RPM, (11, 12), (13, 14)))
    assert decoder.feed(record, 0.0) == [LostRecord(3)]
    assert decoder.group_statistics.damaged_groups == 1


def test_ticks_that_leap_are_dropped_unless_the_next_ones_go_on_from_there() -> None:
    """The tick counts of a report jump.

    The decoder drops this report, and accepts the next one, whether it continues the counts before
    or after the jump.
    """
    decoder = LoisDecoder()
    said = [
        Ticks(400, 1000, 1001),
        Ticks(800, 1010, 1011),
        Ticks(1200, 1020, 90000),
        Ticks(1600, 1030, 1031),
        Ticks(410, 0, 1),
        Ticks(810, 10, 11),
        Ticks(1210, 20, 21),
    ]
    found: list[Report] = []
    for step, ticks in enumerate(said):
        found += decoder.feed(encode_report(ticks), 0.4 * step)
    found += decoder.flush(9.0)
    assert found == [said[0], said[1], said[3], said[5], said[6]]
    assert decoder.group_statistics.implausible == 2


@pytest.mark.parametrize(
    "line",
    [
        b":050000000239\n",
        b":0e00183b3b66\n",
        b":0f000d2c2b67\n",
        b":100000016a6e\n",
        b":990000000032\n",
    ],
)
def test_a_right_line_that_says_nothing_is_counted(line: bytes) -> None:
    """A valid line of unknown kind or with a value out of range is counted, and gives no report."""
    total = 0
    for character in line[:11]:
        total ^= character
    decoder = LoisDecoder()
    assert decoder.feed(line[:11] + b"%02x\n" % total, 0.0) == []
    assert decoder.group_statistics.unknown_lines == 1


@pytest.mark.parametrize("unit", ["ms", "ns"])
def test_the_unit_of_the_boards_clock_is_learnt(unit: str) -> None:
    """The decoder learns the unit of the board's clock from the reports.

    The clock counts ns in the manual, but ms in the public firmware.
    """
    said = reports(4.0, firmware=unit == "ms")
    _, decoder = decoded(pieces(said))
    assert decoder.clock_unit == unit


def test_a_line_that_lost_its_end_costs_no_other() -> None:
    """A line has lost its line end.

    The colon of the next line shows that a new line begins. So the next line is decoded.
    """
    heading = encode_report(Heading(5))
    decoder = LoisDecoder()
    assert decoder.feed(b"x:\xff:12" + heading[:9] + heading, 0.0) == [Heading(5)]
    assert decoder.statistics.faults == 1


def test_a_wrong_checksum_is_refused_and_a_missing_one_only_where_it_is_required() -> None:
    """A line with a wrong checksum is always discarded.

    A line without a checksum is discarded only if the decoder requires checksums.
    """
    heading = encode_report(Heading(5))
    for sum_required in (True, False):
        decoder = LoisDecoder(sum_required=sum_required)
        assert decoder.feed(heading[:12] + b"0\n", 0.0) == []
        assert decoder.feed(heading[:11] + b"\n", 0.0) == ([] if sum_required else [Heading(5)])
        assert decoder.feed(heading, 0.0) == [Heading(5)]


def test_a_line_that_lost_two_characters_is_no_line_without_a_checksum() -> None:
    """A line that lost two characters looks like a line without a checksum.

    The decoder drops this line. It also drops the first eight real lines without a checksum, and
    accepts the next.
    """
    decoder = LoisDecoder(sum_required=False)
    heading, short = encode_report(Heading(0)), b":100000003b\n"
    assert decoder.feed(heading, 0.0) == [Heading(0)]
    assert heading[:7] + heading[9:] == short
    assert decoder.feed(short + heading, 0.1) == [Heading(0)]
    found = decoder.feed(b":1000000005\n" * 10, 0.2)
    assert found == [Heading(5)] * 2


def test_half_an_odometry_group_of_zeros_is_not_a_report_of_ticks() -> None:
    """The driver reads the second half of an odometry group of zeros late.

    The decoder does not take this half for a tick report, whose clock of 0 would show a restart.
    """
    ticks, odometry = Ticks(4317, 0, 0), BoardOdometry(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, appended=True)
    decoder = LoisDecoder()
    found = decoder.feed(encode_report(ticks) + encode_report(odometry), 0.0)
    found += decoder.feed(b"", 0.1)
    assert found == [ticks, odometry]
    later = encode_report(Ticks(4519, 0, 0)) + encode_report(odometry)
    found = decoder.feed(later[: 14 * 8], 0.2) + decoder.feed(b"", 0.4)
    found += decoder.feed(later[14 * 8 :], 0.5) + decoder.feed(encode_report(Heading(5)), 0.6)
    assert found == [Ticks(4519, 0, 0), Heading(5)]


def test_lines_of_a_sensor_come_out_where_they_are_expected() -> None:
    """The decoder passes sensor lines on in a terminal mode.

    In other modes they count as damage.
    """
    data = b"$HEHDT,12.3,T*1F\r\n\xff\xfe\n" + encode_report(Heading(5))
    decoder = LoisDecoder()
    assert decoder.feed(data, 0.0) == [Heading(5)]
    assert decoder.statistics.faults == 2
    decoder.terminal = True
    assert decoder.feed(data, 0.0) == [TerminalLine("$HEHDT,12.3,T*1F"), Heading(5)]
    assert decoder.statistics.faults == 3
