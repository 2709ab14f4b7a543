# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the serial line with faults, through which a simulated board sends."""

import pytest
import toy_lines
import toy_udp
from hypothesis import given
from hypothesis import strategies as st

from omnibot_driver.simulator.common import options
from omnibot_driver.simulator.common.faults import FaultyLine, LineFaults

SENT = bytes(range(256)) * 400


def bits(value: int) -> int:
    return value.bit_count()


def test_a_line_without_faults_changes_nothing() -> None:
    """A line without faults carries all bytes unchanged, and its fault counters stay at zero."""
    line = FaultyLine(LineFaults())
    assert line.carry(SENT) == SENT
    assert (line.lost, line.flipped) == (0, 0)


@given(st.lists(st.integers(0, 2000), max_size=5).map(sorted), st.integers(0, 3))
def test_the_fate_of_a_byte_does_not_depend_on_how_the_stream_is_cut(
    cuts: list[int], seed: int
) -> None:
    """A stream is sent in one piece and in chunks.

    Both times, the same bytes are lost or changed, also in bursts.
    """
    faults, data = LineFaults(lose=0.01, burst=0.005, flip=0.01), SENT[:2000]
    line = FaultyLine(faults, seed)
    parts = [
        line.carry(data[start:end]) for start, end in zip([0, *cuts], [*cuts, 2000], strict=True)
    ]
    assert b"".join(parts) == FaultyLine(faults, seed).carry(data)


def test_single_bytes_are_lost_at_the_given_rate() -> None:
    """With a loss rate of 0.01, one byte in a hundred is lost, and no byte is changed."""
    line = FaultyLine(LineFaults(lose=0.01))
    assert len(line.carry(SENT)) == len(SENT) - line.lost
    assert line.lost == pytest.approx(len(SENT) / 100, rel=0.2)


def test_bursts_of_1_to_200_bytes_are_lost() -> None:
    """The number of lost bytes fits bursts of 1 to 200 bytes, which have 100.5 on average."""
    line = FaultyLine(LineFaults(burst=0.0005))
    arrived = line.carry(SENT)
    assert len(arrived) == len(SENT) - line.lost
    assert line.lost == pytest.approx(len(SENT) * 0.0005 * 100.5, rel=0.5)


def test_a_flip_changes_one_bit_and_no_length() -> None:
    """With a flip rate of 0.01, one bit is changed in one byte of a hundred. No byte is lost."""
    line = FaultyLine(LineFaults(flip=0.01))
    arrived = line.carry(SENT)
    changes = [bits(was ^ now) for was, now in zip(SENT, arrived, strict=True)]
    assert max(changes) == 1
    assert sum(changes) == line.flipped == pytest.approx(len(SENT) / 100, rel=0.2)


@pytest.mark.parametrize("rate", ["-0.1", "1.1", "nan", "often"])
def test_a_rate_that_is_not_a_chance_is_refused(rate: str) -> None:
    """The program rejects a rate that is not a number from 0 to 1. The message says the range."""
    for name, toy in (("lose", toy_lines), ("flip", toy_lines), ("duplicate", toy_udp)):
        with pytest.raises(options.OptionError, match="give a number from 0 to 1"):
            options.from_words([f"--{name}={rate}"], toy)


@pytest.mark.parametrize("delay", ["-0.1", "61", "nan", "long"])
def test_a_delay_that_nobody_waits_for_is_refused(delay: str) -> None:
    """The program rejects a delay that is not a number from 0 to 60, in s."""
    with pytest.raises(options.OptionError, match="give seconds from 0 to 60"):
        options.from_words([f"--delay={delay}"], toy_udp)
