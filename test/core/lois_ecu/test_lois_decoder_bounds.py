# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Limits of the LOIS decoder: it accepts any bytes, and lost bytes give no wrong value.

``LOIS_SEEDS=100 pytest -s -k byte_loss`` measures longer and prints the results.
"""

import os
from collections import Counter
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lois_streams import decoded, lossy, pieces, reports

from omnibot_driver.core.lois_ecu import (
    BoardOdometry,
    LoisDecoder,
    Record,
    RecordKind,
    encode_report,
)
from omnibot_driver.core.lois_ecu.messages import Report

WHICH = ((True, False), (False, True), (False, False))
"""Settings of the tests: whether lines have checksums, and whether the firmware is the public
firmware."""
SEEDS = int(os.environ.get("LOIS_SEEDS", "1"))
payloads = st.one_of(st.sampled_from([0, 0xFFFFFFFF, 0x016A016A]), st.integers(0, 2**32 - 1))
codes = st.sampled_from([0x04, 0x05, 0x0C, 0x0D, 0x10, 0x12, 0x17, 0x20])


@given(st.lists(st.binary(max_size=600), max_size=8), st.booleans())
def test_any_bytes_are_taken_in_any_chunks_with_equal_results(
    chunks: list[bytes], terminal: bool
) -> None:
    """Any bytes raise no error, and the reports do not depend on the chunks.

    Between calls, the decoder holds fewer than 256 bytes.
    """
    data = b"".join(chunks)
    results = []
    for cut in (chunks, [data], [bytes([byte]) for byte in data]):
        decoder = LoisDecoder(sum_required=False)
        decoder.terminal = terminal
        found: list[Report] = []
        for chunk in cut:
            found += decoder.feed(chunk, 0.0)
            assert len(decoder._held) < 256
        found += decoder.flush(0.0)
        results.append((found, decoder.statistics, decoder.group_statistics))
    assert results[0] == results[1] == results[2]


@pytest.mark.slow
@given(
    st.lists(st.tuples(codes, payloads, st.integers(0, 13), st.integers(0, 9)), max_size=60),
    st.sampled_from(RecordKind),
)
def test_any_lines_are_taken_in_any_chunks_with_equal_results(
    lines: list[tuple[int, int, int, int]], kind: RecordKind
) -> None:
    """Valid and damaged lines arrive in any order and any chunks.

    The reports do not depend on the chunks.
    """
    data = b""
    for code, payload, at, harm in lines:
        line = b":%02x%08x" % (code, payload)
        total = 0
        for character in line:
            total ^= character
        line += b"%02x\n" % total
        data += line if harm else line[:at] + line[at + 1 :]
    results = []
    for cut in ([data], [bytes([byte]) for byte in data]):
        decoder = LoisDecoder()
        decoder.expect_record(kind, 4, 3)
        found: list[Report] = []
        for chunk in cut:
            found += decoder.feed(chunk, 0.0)
        found += decoder.flush(0.0)
        results.append((list(map(repr, found)), decoder.statistics, decoder.group_statistics))
    assert results[0] == results[1]


@pytest.mark.parametrize("code", [b"17", b"04"])
def test_motors_without_current_are_no_end_of_a_torque_record(code: bytes) -> None:
    """A torque sample of 0/0 does not end a record.

    The manual and the firmware have different command bytes for these records. Both are tested.
    """
    decoder = LoisDecoder()
    decoder.expect_record(RecordKind.TORQUE, 3, 3)
    zero, some = b":" + code + b"00000000", b":" + code + b"00010002"
    found: list[Report] = []
    for text in (zero, some, zero, zero):
        total = 0
        for character in text:
            total ^= character
        found += decoder.feed(text + b"%02x\n" % total, 0.0)
    assert found == [Record(RecordKind.TORQUE, (0, 1, 0), (0, 2, 0))]


def test_a_record_without_end_is_not_kept() -> None:
    """A record never ends. The decoder holds at most the requested number of samples."""
    decoder = LoisDecoder()
    decoder.expect_record(RecordKind.RPM, 10, 10)
    decoder.feed(b":04000a000b3d\n" * 5000, 0.0)
    assert len(decoder._assembler._record._payloads) == 10


@pytest.mark.slow
@pytest.mark.parametrize(
    ("chance", "sum_required", "firmware"),
    [(1e-3, True, True), (1e-3, False, False), *((1e-2, *which) for which in WHICH)],
)
def test_no_value_is_wrong_at_byte_loss(chance: float, sum_required: bool, firmware: bool) -> None:
    """Bytes are lost during drives of ten minutes. No report is wrong.

    At least 85 % of the reports that lost no byte are decoded.
    """
    sent, came, wrong = Counter[str](), Counter[str](), Counter[str]()
    for seed in range(SEEDS):
        said = reports(600.0, firmware=firmware)
        stream = pieces(said)
        true = {data for _, data in stream}
        if not sum_required:
            stream = [
                (at, b"".join(line[:11] + b"\n" for line in data.splitlines()))
                for at, data in stream
            ]
        found, _ = decoded(lossy(stream, chance, Random(seed)), sum_required=sum_required)
        for _, report in said:
            sent[_kind(report)] += 1
        for report in found:
            came[_kind(report)] += 1
            wrong[_kind(report)] += encode_report(report) not in true
    print(f"\nloss {chance:g}, sum {sum_required}, firmware {firmware}: wrong {dict(wrong)}")
    print({kind: f"{came[kind] / sent[kind]:.3f} of {sent[kind]}" for kind in sent})
    assert not any(wrong.values())
    for kind in sent:
        characters = {"BoardOdometry": 98, "appended": 98, "Ticks": 56, "GpsPosition": 42}
        expected = (1 - chance) ** characters.get(kind, 14)
        assert came[kind] > 0.85 * expected * sent[kind]


def _kind(report: Report) -> str:
    if isinstance(report, BoardOdometry) and report.appended:
        return "appended"
    return type(report).__name__
