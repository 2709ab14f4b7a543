# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of messages whose last lines are read late or are lost."""

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lois_streams import Piece, reports

from omnibot_driver.core.lois_ecu import (
    BoardOdometry,
    GpsPosition,
    LoisDecoder,
    Ticks,
    encode_report,
)
from omnibot_driver.core.lois_ecu.messages import Report

FIRMWARE = pytest.mark.parametrize("firmware", [True, False], ids=["firmware", "documented"])


def heard(given: list[Piece]) -> tuple[list[Report], LoisDecoder]:
    """Decode the pieces, and return all reports and the decoder.

    Some reports are complete only when no more data comes for a while. They are included.
    """
    decoder, found = LoisDecoder(), list[Report]()
    for at, data in given:
        if decoder.resolves_at <= at:
            found += decoder.feed(b"", decoder.resolves_at)
        found += decoder.feed(data, at)
    return found + decoder.flush(given[-1][0]), decoder


@pytest.mark.slow
@FIRMWARE
@pytest.mark.parametrize("pause_s", [0.06, 0.14])
def test_a_group_whose_rest_is_read_late_is_not_lost(firmware: bool, pause_s: float) -> None:
    """The board sends bursts of lines. The host reads each burst in two parts, ``pause_s`` apart.

    No report is lost.
    """
    said = reports(1.6, firmware=firmware)
    bursts = [
        (at, b"".join(encode_report(report) for _, report in group))
        for at, group in itertools.groupby(said, key=lambda one: one[0])
    ]
    for cut in range(1, len(bursts[0][1])):
        read = [
            piece for at, data in bursts for piece in ((at, data[:cut]), (at + pause_s, data[cut:]))
        ]
        found, decoder = heard(read)
        assert found == [report for _, report in said], cut
        assert decoder.group_statistics.damaged_groups == 0


@pytest.mark.slow
@settings(max_examples=40)
@given(st.data(), st.booleans())
def test_any_chunks_and_pauses_give_the_reports_of_one_read(data: st.DataObject, cut: bool) -> None:
    """The host reads each burst of lines in several parts, all within 145 ms.

    The reports are the same as if each burst came in one read.
    """
    firmware = data.draw(st.booleans())
    said = reports(2.4, firmware=firmware)
    read: list[Piece] = []
    for at, group in itertools.groupby(said, key=lambda one: one[0]):
        burst, now, begin = b"".join(encode_report(report) for _, report in group), at, 0
        ends = data.draw(st.lists(st.integers(1, len(burst)), max_size=4)) if cut else []
        for end in [*sorted(ends), len(burst)]:
            read.append((now, burst[begin:end]))
            begin = end
            now = data.draw(st.floats(now, at + 0.145))
    found, decoder = heard(read)
    assert found == [report for _, report in said]
    assert decoder.group_statistics.damaged_groups == 0


@pytest.mark.parametrize("step_s", [0.1, 0.2, 0.4, 2.0])
@pytest.mark.parametrize("kind", ["ticks", "ticks and odometry", "odometry", "position"])
def test_lines_of_two_groups_never_make_one_group(kind: str, step_s: float) -> None:
    """Lines of two damaged bursts never form one report: their arrival times are too far apart."""
    groups: list[list[Report]] = []
    for n in range(1, 7):
        ticks = Ticks(int(1000 * step_s * n), 7 + 3 * n, 5 + 2 * n)
        pose = BoardOdometry(0.125 * n, 0.25 * n, 0.5 * n, 0.5, 0.25, 0.125 * n)
        appended = BoardOdometry(
            *(pose.x_m, pose.y_m, pose.yaw_rad, 0.25, 0.5, 0.125), appended=True
        )
        groups.append(
            {
                "ticks": [ticks],
                "ticks and odometry": [ticks, appended],
                "odometry": [pose],
                "position": [GpsPosition(48.0 + 0.125 * n, 11.0 + 0.25 * n)],
            }[kind]
        )
    bursts = [b"".join(map(encode_report, group)).splitlines(keepends=True) for group in groups]
    sent = [report for group in groups for report in group]
    for kept, lost in itertools.product(range(1, len(bursts[0])), repeat=2):
        harmed = [*bursts[:3], bursts[3][:kept], bursts[4][lost:], bursts[5]]
        found, _ = heard([(step_s * n, b"".join(lines)) for n, lines in enumerate(harmed, 1)])
        assert all(report in sent for report in found), (kept, lost)
        whole = sent[: 3 * len(groups[0])] + sent[5 * len(groups[0]) :]
        assert all(report in found for report in whole), (kept, lost)
