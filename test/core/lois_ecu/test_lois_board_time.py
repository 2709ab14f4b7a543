# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The delay of a read, estimated from the board's time in each tick report."""

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnibot_driver.core.lois_ecu.board_time import BoardTime


@pytest.mark.parametrize("lost", [0.0, 0.067], ids=["goes on", "stands while it sends"])
def test_a_read_that_is_late_is_told(lost: float) -> None:
    """A read is 40 ms late. The driver estimates this delay correctly, within 3 ms.

    This is also true for a board whose clock stops while it sends.
    """
    board = BoardTime()
    found = []
    for step in range(60):
        late_s = 0.04 if step == 50 else 0.0
        board.sent(11)
        counts = round(200 * step * (1 - lost))
        found.append(board.late_s(counts, "ms", 10.0 + 0.2 * step + late_s))
    assert found[50] == pytest.approx(0.04, abs=0.003)
    assert max(found[10:50]) < 0.003
    assert board.stddev_s < 0.003


def test_of_groups_that_are_read_at_once_none_is_older_than_the_one_before() -> None:
    """Several tick reports are read together.

    Their estimated sending times are in the order in which the board sent them.
    """
    board = BoardTime()
    taken_s = []
    for step in range(60):
        board.sent(11)
        read_s = 0.6 * (step // 3 + 1)
        late_s = board.late_s(round(201 * step * 0.93), "ms", read_s)
        assert late_s >= 0.0
        taken_s.append(read_s - late_s)
    assert taken_s == sorted(taken_s)


def test_its_error_is_that_of_the_reads() -> None:
    """For reads up to 30 ms late, the estimated standard deviation of the delay is 5 to 25 ms."""
    board, random = BoardTime(), Random(1)
    for step in range(100):
        board.sent(4)
        board.late_s(200_000_000 * step % 2**32, "ns", 0.2 * step + random.uniform(0.0, 0.03))
    assert 0.005 < board.stddev_s < 0.025


def test_nothing_is_said_before_the_unit_is_known_and_after_a_restart() -> None:
    """The estimated delay is 0 while the unit of the board's clock is unknown, and after a restart.

    After a restart, the standard deviation of the delay is 12 ms.
    """
    board = BoardTime()
    assert board.late_s(0, None, 0.0) == 0.0
    for step in range(20):
        board.late_s(200 * step, "ms", 0.2 * step)
    assert board.late_s(0, "ms", 4.0) == 0.0
    assert board.stddev_s == 0.012


def test_a_stall_of_the_reader_ends_with_twenty_groups_in_one_read() -> None:
    """The host stalls, and then one read takes twenty tick reports at once.

    Ten reports later, the estimated delays are right again.
    """
    board = BoardTime()
    found = []
    for step in range(90):
        read_s = 14.0 if 50 <= step < 70 else 0.2 * step
        found.append(board.late_s(200 * step, "ms", read_s))
    assert found[69] < 0.25
    assert max(found[80:]) < 0.01
    assert board.stddev_s < 0.015


@pytest.mark.slow
@given(
    st.lists(
        st.tuples(st.sampled_from([0.0, 1e-6, 0.01, 0.2, 4.0]), st.integers(0, 400)), min_size=8
    )
)
def test_whatever_the_reads_are_a_delay_is_finite_and_no_group_is_older(
    reads: list[tuple[float, int]],
) -> None:
    """Reads come at any times, and the board's clock has any rate.

    The estimated delays are finite, and the estimated sending times never decrease.
    """
    board, now, counts, taken_s = BoardTime(), 10.0, 0, 0.0
    for seconds, passed in reads * 3:
        now, counts = now + seconds, counts + passed
        late_s = board.late_s(counts, "ms", now)
        assert 0.0 <= late_s < 0.25
        assert now - late_s >= taken_s
        assert board.stddev_s < 10.0
        taken_s = now - late_s


@pytest.mark.parametrize("leap_s", [-0.2, -0.05, 0.05, 0.2])
def test_a_clock_that_leaps_deviates_from_the_last_groups(leap_s: float) -> None:
    """The board's clock jumps by ``leap_s``.

    By this clock, the next tick report seems delayed by −``leap_s`` instead of about 0. The driver
    regards this delay as irregular.
    """
    board, now = settled_on_time(), 0.2 * 60
    usual_s, certain = board.deviation_s(nanoseconds(now), "ns", now)
    assert usual_s == pytest.approx(0.0, abs=0.001)
    assert not certain
    deviation_s, certain = board.deviation_s(nanoseconds(now + leap_s), "ns", now)
    assert deviation_s == pytest.approx(-leap_s, abs=0.001)
    assert certain


def test_a_late_read_is_certain_only_if_reads_are_usually_in_time() -> None:
    """Reads are often up to 0.1 s late. One more read that is 0.1 s late is not irregular.

    A read that seems 0.06 s early is irregular, because late reads cannot explain an early read.
    """
    board, random = BoardTime(), Random(2)
    for step in range(60):
        now = 0.2 * step
        board.late_s(nanoseconds(now), "ns", now + random.uniform(0.0, 0.1))
    now = 0.2 * 60
    assert not board.deviation_s(nanoseconds(now), "ns", now + 0.1)[1]
    assert board.deviation_s(nanoseconds(now + 0.06), "ns", now)[1]


def test_nothing_deviates_before_enough_groups_are_known() -> None:
    """Every delay is regarded as regular until enough tick reports have arrived.

    Every delay is also regarded as regular while the unit of the board's clock is unknown.
    """
    board = BoardTime()
    assert board.deviation_s(0, "ns", 5.0) == (0.0, False)
    board.late_s(0, "ns", 0.0)
    assert board.deviation_s(nanoseconds(1.0), "ns", 0.2) == (0.0, False)
    assert settled_on_time().deviation_s(0, None, 12.0) == (0.0, False)


def nanoseconds(board_s: float) -> int:
    return round(board_s * 1e9) % 2**32


def settled_on_time() -> BoardTime:
    """Return an estimator that has processed 60 tick reports, all read in time.

    The board's clock counts ns.
    """
    board = BoardTime()
    for step in range(60):
        board.late_s(nanoseconds(0.2 * step), "ns", 0.2 * step)
    return board
