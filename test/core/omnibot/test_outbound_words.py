# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the zeros before frames, and of 16-bit words whose bytes could act as commands."""

import re

import pytest
from frame_strategies import words
from hypothesis import example, given
from hypothesis import strategies as st
from session_bench import bare

from omnibot_driver.core.commands.limits import slow
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.omnibot import OmniBot, OmniBotSettings
from omnibot_driver.core.omnibot.command_encoder import CommandEncoder
from omnibot_driver.core.omnibot.outbound import MAX_WORD, harmless, nearest
from omnibot_driver.core.packets import joined

COUNTS = st.floats(-32767.0, 32767.0)
finite = st.floats(allow_nan=False, allow_infinity=False)


def payload(a: int, b: int, c: int) -> bytes:
    return b"".join((word & 0xFFFF).to_bytes(2, "big") for word in (a, b, c))


def words_of(counts: list[float]) -> tuple[int, ...]:
    """Return the 16-bit words for ``counts``. If they do not fit, all are scaled by one factor."""
    return nearest(*slow(counts, MAX_WORD))


@given(st.tuples(COUNTS, COUNTS, COUNTS))
def test_no_payload_holds_a_letter_or_a_header(counts: tuple[float, float, float]) -> None:
    """The payload of a command contains no letter (S, P, R) and no header.

    A board that misses the frame's header would obey such bytes.
    """
    assert not re.search(rb"[SPR]|\xff\xfe", payload(*harmless(counts)))


@given(st.tuples(words, words, words).filter(lambda w: min(w) > -32768))
def test_harmless_words_stay_as_they_are(counts: tuple[int, int, int]) -> None:
    """Only words that could act as a letter or a header are changed."""
    if not re.search(rb"[SPR]|\xff\xfe", payload(*counts)):
        assert harmless(counts) == counts


@given(st.tuples(*[st.floats(-20479.0, 20479.0)] * 3))
def test_a_word_is_moved_by_one_lsb_where_its_low_byte_would_act(
    counts: tuple[float, float, float],
) -> None:
    """The driver changes a word by one LSB if its low byte could act as a letter or in a header.

    So the word is off by at most 1.5 LSB. From -20,479 to 20,479, no high byte needs a change.
    """
    for word, count in zip(harmless(counts), counts, strict=True):
        assert abs(word - count) <= 1.5


@pytest.mark.parametrize(
    ("counts", "typed"),
    [
        ((80.0, 0.0, 0.0), "00 4F 00 00 00 00"),  # P
        ((80.4, 0.0, 0.0), "00 51 00 00 00 00"),
        ((82.0, 83.0, -176.0), "00 51 00 54 FF 51"),  # R, S, FF 50 -> FF 51
        ((-2.0, 0.0, 0.0), "FF FF 00 00 00 00"),  # FF FE -> FF FF
        ((-2.4, 0.0, 0.0), "FF FD 00 00 00 00"),
        ((255.0, -300.0, 0.0), "00 FE FE D4 00 00"),  # 00 FF | FE D4
        ((0.0, -1.0, -257.0), "00 00 00 00 FE FF"),  # FF FF | FE FF
        ((0x5080, 0.0, 0.0), "51 00 00 00 00 00"),  # a high byte
    ],
)
def test_words_that_would_act_take_the_nearest_value_that_does_not(
    counts: tuple[float, float, float], typed: str
) -> None:
    """Instead of a 16-bit word with harmful bytes, the driver sends the nearest harmless word.

    Harmful bytes are a letter (S, P, R) or a header: a board that misses the frame's header would
    obey them.
    """
    assert payload(*harmless(counts)) == bytes.fromhex(typed)


def test_everything_goes_out_behind_zeros() -> None:
    """Zeros come before each frame and each letter.

    They complete a frame that lost its end. They also wake a board that has just booted.
    """
    board = OmniBot(OmniBotSettings())
    zeros = "00 00 00 00 00 00 00 00 "
    stop = zeros + "ff fe 02 00 00 00 00 00 00"
    assert joined(board.stop()).hex(" ") == stop
    assert joined(board.emergency_stop()).hex(" ") == zeros + "ff fe 10 00 00 00 00 00 00"
    assert joined(board.start()).hex(" ") == zeros + "53"
    assert joined(board.force_pause()).hex(" ") == f"{stop} {zeros}53 {zeros}50"
    assert joined(board.reset()).hex(" ") == f"{stop} {zeros}52"
    command = CommandEncoder(OmniBotSettings()).velocity(BodyTwist(0.2, -0.1, 0.5))
    assert command.hex(" ") == zeros[:12] + "ff fe 01 00 0e ff f9 00 fa"


@pytest.mark.parametrize("x_mm", [0x5000, 0x5210, 0x53FF])
def test_a_goal_whose_high_byte_is_a_letter_is_refused(x_mm: int) -> None:
    """The high byte of a goal's x is S, P or R, which could start, pause or reset the board.

    The driver rejects the goal: the nearest harmless goal could be 0.26 m away.
    """
    encoder = CommandEncoder(OmniBotSettings())
    with pytest.raises(CommandRefused, match=r"start, pause or reset if the line"):
        encoder.drive_to(Pose(x_mm / 1000, 0.0, 0.0))
    assert bare(encoder.drive_to(Pose(0x4F00 / 1000, 0.0, 0.0)))[3:5] == bytes.fromhex("4F 00")


def test_a_goal_whose_low_byte_is_a_letter_is_moved_by_a_millimetre() -> None:
    """A goal at 83 mm has the letter S as its low byte.

    The driver sends a goal at 84 mm instead.
    """
    encoder = CommandEncoder(OmniBotSettings())
    assert bare(encoder.drive_to(Pose(0.083, 0.0, 0.0)))[3:5] == bytes.fromhex("00 54")


@given(st.lists(st.floats(-32767, 32767), min_size=3, max_size=3))
@example([0.5, -0.5, 1.5])
@example([0.49999999999999994, 2.5, -2.4999])
def test_words_are_the_nearest_integers(counts: list[float]) -> None:
    """Words are rounded to the nearest integer, not truncated towards zero."""
    for word, count in zip(words_of(counts), counts, strict=True):
        assert isinstance(word, int)
        assert abs(word - count) <= 0.5


@given(st.lists(st.floats(-32767, 32767), min_size=3, max_size=3))
def test_rounding_is_the_same_to_both_sides(counts: list[float]) -> None:
    """Positive and negative values are rounded alike. Otherwise the robot would drift."""
    mirrored = words_of([-count for count in counts])
    assert mirrored == tuple(-word for word in words_of(counts))


def test_halves_are_rounded_away_from_zero() -> None:
    """Halves are rounded away from zero, also next to even numbers: 10.5 LSB are sent as 11."""
    assert words_of([0.5, -0.5, 10.5]) == (1, -1, 11)


@given(st.lists(finite, min_size=3, max_size=3))
@example([1e308, -1e308, 5e307])
@example([32768.0, 100.0, 0.0])
def test_words_fit_16_bits_and_keep_the_direction(counts: list[float]) -> None:
    """Counts that are too large for 16 bits are all scaled down by one factor.

    Each word is exact to half a count.
    """
    words = words_of(counts)
    assert all(-32768 <= word <= 32767 for word in words)
    largest = max(map(abs, counts))
    if largest > 32767:
        for word, count in zip(words, counts, strict=True):
            assert word == pytest.approx(count / largest * 32767, abs=0.500001)
