# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of what the counter of the deltas shows: lost deltas, wraps, pauses and restarts."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnibot_driver.core.omnibot.sequence import Sequence, Step

counts = st.integers(0, 255)


def begun(count: int) -> Sequence:
    """Return a sequence that has received one delta, with the count ``count``, at 100 s."""
    sequence = Sequence()
    sequence.delta(count, 100.0)
    return sequence


@given(counts, st.integers(0, 1000), st.floats(-0.4, 0.4))
def test_a_gap_is_counted_over_any_wraps_also_when_the_line_is_late(
    count: int, lost: int, late_s: float
) -> None:
    """Up to 1000 deltas are lost. The next delta comes up to 0.4 s too early or too late.

    The lost deltas are counted correctly, although the counter wraps.
    """
    step = begun(count).delta((count + 1 + lost) % 256, 100.0 + 0.04 * (lost + 1) + late_s)
    assert step == Step(lost)


@given(counts, st.floats(0.0, 5.0))
def test_the_next_count_is_not_a_gap_however_late_it_comes(count: int, late_s: float) -> None:
    """A delta that continues the count comes up to 5 s late. The board sends no poses.

    The driver counts no delta as lost, and does not assume a restart.
    """
    assert begun(count).delta((count + 1) % 256, 100.04 + late_s) == Step(0)


@given(counts, st.floats(0.0, 1000.0))
def test_a_pause_takes_up_the_count(count: int, paused_s: float) -> None:
    """The first delta after a pause continues the count.

    The driver counts no delta as lost, does not know the duration of this delta, and assumes a
    restart only if the count is 0.
    """
    sequence = begun(count)
    sequence.pause()
    step = sequence.delta((count + 1) % 256, 100.0 + paused_s)
    assert replace(step, doubtful=False) == Step(0, None, restarted=count == 255)


@given(counts, counts, st.floats(1.0, 1000.0))
def test_after_a_pause_any_count_but_the_next_one_may_be_that_of_a_restarted_board(
    count: int, first: int, after_s: float
) -> None:
    """A board that sends poses is paused. The first delta afterwards does not continue the count.

    The driver suspects a restart, until the next pose decides. It also suspects a restart if the
    count is 0.
    """
    sequence = Sequence()
    for number in range(11):
        at_s = 100.0 + (number - 10) * 0.04
        sequence.delta((count + number - 10) % 256, at_s)
        if number % 5 == 0:
            sequence.pose(number // 5, at_s)
    sequence.pause()
    step = sequence.delta(first, 100.0 + after_s)
    assert replace(step, doubtful=False) == Step(
        0, None, restarted=first == 0 or first != (count + 1) % 256
    )


@given(counts, counts, st.floats(1.0, 1000.0))
def test_without_poses_only_a_low_count_after_a_pause_is_that_of_a_restarted_board(
    count: int, first: int, after_s: float
) -> None:
    """A board that sends no poses is paused. Then a delta with another count arrives.

    The driver suspects a restart only if a restart means at most as many lost deltas as a
    continued count.
    """
    sequence = begun(count)
    sequence.pause()
    step = sequence.delta(first, 100.0 + after_s)
    assert replace(step, doubtful=False) == Step(
        0, None, restarted=first <= (first - count - 1) % 256
    )


@pytest.mark.parametrize(
    ("before", "first", "doubtful"),
    [
        (20, 21, False),
        (20, 22, True),
        (20, 45, True),
        (20, 0, False),
        (20, 3, False),
        (240, 0, False),
        (240, 3, False),
        (240, 250, True),
    ],
)
def test_a_restart_after_a_pause_is_doubtful_if_a_board_that_continued_lost_fewer_deltas(
    before: int, first: int, doubtful: bool
) -> None:
    """After a pause, the driver assumes a restart if the first delta does not continue the count.

    The restart is doubtful if fewer deltas would be lost without a restart.
    """
    sequence = begun(before - 10)
    for number in range(11):
        sequence.delta(before - 10 + number, 100.0 + number * 0.04)
        if number % 5 == 0:
            sequence.pose(number // 5, 100.0 + number * 0.04)
    sequence.pause()
    step = sequence.delta(first, 151.0)
    assert (step.restarted, step.doubtful) == (first != before + 1, doubtful)


@pytest.mark.parametrize("count", [20, 77, 150, 240])
def test_a_restart_without_a_word_shows_in_the_time(count: int) -> None:
    """A delta has the count 0 two seconds after the last delta, so the board has restarted.

    Without a restart, the count could not be 0 after this time.
    """
    assert begun(count).delta(0, 102.0).restarted


@pytest.mark.parametrize("imus", [0, 4])
@pytest.mark.parametrize("drift", [-0.01, 0.01])
@pytest.mark.parametrize("elapsed_s", [20.0, 120.0, 400.0])
def test_a_long_gap_of_a_board_whose_clock_drifts_is_not_a_restart(
    elapsed_s: float, drift: float, imus: int
) -> None:
    """The serial line is unplugged for up to 400 s, and the board's clock is wrong by 1 %.

    The driver counts the lost deltas, and does not assume a restart.
    """
    sequence = begun(100)
    passed = round(elapsed_s / 0.04 * (1 + drift))
    step = sequence.delta((100 + passed) % 256, 100.0 + elapsed_s, imus=imus)
    after = sequence.delta((101 + passed) % 256, 100.04 + elapsed_s, imus=4)
    assert not step.restarted
    assert not after.restarted
    assert step.lost + after.lost == passed - 1


def test_a_gap_of_3029_deltas_of_a_fast_board_is_counted() -> None:
    """A board whose clock is 1 % fast sends 3030 deltas in 120 s, instead of 3000.

    Only the last of these deltas arrives. The driver counts 3029 lost deltas.
    """
    sequence = Sequence()
    sequence.delta(100, 0.0)
    assert sequence.delta((100 + 3030) % 256, 120.0) == Step(3029)


@pytest.mark.parametrize("wraps", [0, 1, 3])
def test_a_supposed_restart_is_withdrawn_after_any_wraps(wraps: int) -> None:
    """A supposed restart is withdrawn when the next delta continues the old count.

    The restart was supposed because a false delta had a count near zero. The counter may have
    wrapped since the last true delta.
    """
    sequence = begun(88)
    passed = 1 + 256 * wraps
    assert sequence.delta(1, 100.02 + 10.24 * wraps, imus=1).restarted
    step = sequence.delta((88 + passed) % 256, 100.04 + 10.24 * wraps, imus=2)
    assert step == Step(passed - 1)


def test_a_line_opened_again_on_another_board_is_as_good_as_a_restart() -> None:
    """After a reconnection to another board, the driver assumes a restart.

    It does so even if the next count is too high for a board that has just restarted.
    """
    sequence = begun(7)
    sequence.reconnect()
    assert sequence.delta(200, 103.0) == Step(0, None, restarted=True)


def test_a_count_that_comes_again_is_not_a_wrap() -> None:
    """A false delta comes too early. The true delta, with the same count, follows.

    The driver does not take the repeated count for a wrap, so it counts no delta as lost.
    """
    sequence = begun(9)
    assert sequence.delta(10, 100.02, imus=2) == Step(0)
    assert sequence.delta(10, 100.04, imus=2) == Step(0)
    assert sequence.delta(11, 100.08, imus=4) == Step(0)
    assert sequence.delta(12, 100.12, imus=4) == Step(0)


def test_a_count_far_ahead_of_the_time_is_believed_when_the_next_goes_on_from_it() -> None:
    """The host's clock stops, and 100 deltas are lost. By this clock, the next count is too high.

    The driver counts the losses only when the following delta continues this count.
    """
    sequence = begun(9)
    assert sequence.delta(110, 100.04, imus=4) == Step(0)
    assert sequence.delta(111, 100.08, imus=4) == Step(100)
    assert sequence.delta(112, 100.12, imus=4) == Step(0)


def test_a_delta_that_framing_made_up_does_not_begin_the_count_anew() -> None:
    """A false delta, made up of damaged bytes, has a count near zero.

    The next true delta continues the old count. No delta is counted as lost.
    """
    sequence = begun(88)
    assert sequence.delta(1, 100.02, imus=1).restarted
    assert sequence.delta(89, 100.04, imus=2) == Step(0)
    assert sequence.delta(90, 100.08, imus=4) == Step(0)


def test_counters_that_begin_anew_after_a_silence_are_a_restart_all_the_same() -> None:
    """A delta has the count 0 after 3 s of silence, so the board has restarted.

    Without a restart, the count could not be 0 after this time.
    """
    sequence = Sequence()
    sequence.delta(200, 10.0, imus=4)
    assert sequence.delta(0, 13.0, imus=4).restarted
