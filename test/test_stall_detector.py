# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Whether the watchdog's thread stood still, and which commands had waited meanwhile."""

import pytest

from omnibot_driver.guard import LIMIT_S
from omnibot_driver.keeper import BEAT_S
from omnibot_driver.stall_detector import SETTLE_S, STANDSTILL_S, StallDetector

DAY_NS = 1_700_000_000_000_000_000
"""The time of day when the steady clock shows 0."""


def wall_ns(now: float) -> int:
    return DAY_NS + round(now * 1e9)


def resumed(length_s: float) -> StallDetector:
    """Ran until 100, and again from ``length_s`` later on."""
    standstill = StallDetector()
    standstill.passed(100.0, wall_ns(100.0))
    standstill.begun(100.0 + length_s)
    standstill.passed(100.0 + length_s, wall_ns(100.0 + length_s))
    return standstill


def test_a_thread_that_passes_in_time_does_not_stand_still() -> None:
    """A busy machine may keep it waiting a little."""
    standstill = StallDetector()
    assert standstill.begun(5.0) == 0.0  # not even before it ever ran
    for now in (10.0, 10.1, 10.45):
        assert standstill.begun(now) == 0.0
        standstill.passed(now, wall_ns(now))
        assert standstill.outlived_by(wall_ns(now), now)


def test_a_standstill_is_told_once_with_its_length() -> None:
    """Whichever thread runs first afterwards; the next standstill is told again."""
    standstill = StallDetector()
    standstill.passed(100.0, wall_ns(100.0))
    assert standstill.begun(103.0) == pytest.approx(3.0)
    assert standstill.begun(103.1) == 0.0
    standstill.passed(103.2, wall_ns(103.2))
    assert standstill.begun(103.3) == 0.0
    assert standstill.begun(110.0) == pytest.approx(6.8)


def test_nothing_is_fresh_until_the_watchdog_runs_again() -> None:
    """Another thread may run first, or alone."""
    standstill = StallDetector()
    standstill.passed(100.0, wall_ns(100.0))
    assert not standstill.outlived_by(wall_ns(100.0 + STANDSTILL_S), 100.0 + STANDSTILL_S)
    standstill.begun(103.0)
    assert not standstill.outlived_by(wall_ns(103.5), 103.5)


def test_a_command_sent_during_the_standstill_is_never_fresh() -> None:
    """However late a retransmission brings it; later than ten seconds none does."""
    standstill = resumed(5.0)
    standstill.passed(108.0, wall_ns(108.0))
    assert not standstill.outlived_by(wall_ns(104.9), 108.0)
    assert standstill.outlived_by(wall_ns(105.5), 108.0)
    standstill.passed(116.0, wall_ns(116.0))
    assert standstill.outlived_by(wall_ns(104.9), 116.0)


@pytest.mark.parametrize("skew_s", [-1e6, 1e6])
def test_with_a_wrong_clock_at_the_sender_only_what_comes_at_once_is_suspect(skew_s: float) -> None:
    """It cannot lock itself out."""
    standstill = resumed(5.0)
    assert not standstill.outlived_by(wall_ns(104.9 + skew_s), 105.0 + SETTLE_S / 2)
    standstill.passed(106.0, wall_ns(106.0))
    assert standstill.outlived_by(wall_ns(105.9 + skew_s), 106.0)


def test_whenever_the_guard_steps_in_the_driver_notices() -> None:
    """Otherwise the two of them would contradict each other on the line."""
    assert 3 * BEAT_S < STANDSTILL_S < LIMIT_S
