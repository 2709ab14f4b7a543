# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the stall detector, which finds stalls of the pacer, the thread that repeats commands.

``outlived_by`` returns False for a command that may have waited during a stall. These tests call
such a command *refused*.
"""

import pytest

from omnibot_driver.guard import LIMIT_S
from omnibot_driver.keeper import BEAT_S
from omnibot_driver.stall_detector import SETTLE_S, STANDSTILL_S, StallDetector

DAY_NS = 1_700_000_000_000_000_000
"""Time of day at which the steady clock shows 0, in ns."""


def wall_ns(now: float) -> int:
    return DAY_NS + round(now * 1e9)


def resumed(length_s: float) -> StallDetector:
    """Return a detector whose thread ran until 100 s, then stalled for ``length_s``."""
    standstill = StallDetector()
    standstill.passed(100.0, wall_ns(100.0))
    standstill.begun(100.0 + length_s)
    standstill.passed(100.0 + length_s, wall_ns(100.0 + length_s))
    return standstill


def test_a_thread_that_passes_in_time_does_not_stand_still() -> None:
    """A small delay of the pacer's thread, as on a busy machine, is not a stall."""
    standstill = StallDetector()
    assert standstill.begun(5.0) == 0.0  # also before its first run
    for now in (10.0, 10.1, 10.45):
        assert standstill.begun(now) == 0.0
        standstill.passed(now, wall_ns(now))
        assert standstill.outlived_by(wall_ns(now), now)


def test_a_standstill_is_told_once_with_its_length() -> None:
    """After a stall, only the first call of ``begun`` returns the length of the stall.

    The length of the next stall is returned once, too.
    """
    standstill = StallDetector()
    standstill.passed(100.0, wall_ns(100.0))
    assert standstill.begun(103.0) == pytest.approx(3.0)
    assert standstill.begun(103.1) == 0.0
    standstill.passed(103.2, wall_ns(103.2))
    assert standstill.begun(103.3) == 0.0
    assert standstill.begun(110.0) == pytest.approx(6.8)


def test_nothing_is_fresh_until_the_pacer_runs_again() -> None:
    """After a stall, every command is refused until the pacer's own thread has run."""
    standstill = StallDetector()
    standstill.passed(100.0, wall_ns(100.0))
    assert not standstill.outlived_by(wall_ns(100.0 + STANDSTILL_S), 100.0 + STANDSTILL_S)
    standstill.begun(103.0)
    assert not standstill.outlived_by(wall_ns(103.5), 103.5)


def stalls_again(standstill: StallDetector, begin: float, end: float) -> None:
    """Let the detector's thread run at ``begin``, then stall until ``end``."""
    standstill.passed(begin, wall_ns(begin))
    standstill.begun(end)
    standstill.passed(end, wall_ns(end))


def test_a_command_that_waited_through_two_standstills_is_not_fresh() -> None:
    """A command may wait in the middleware during several stalls of the driver.

    Until 10 s after the last stall, the driver refuses every command that was sent before its end.
    """
    standstill = resumed(3.0)
    stalls_again(standstill, 103.4, 103.9)
    stalls_again(standstill, 105.5, 106.2)
    standstill.passed(106.6, wall_ns(106.6))
    for sent in (102.99, 103.3, 103.6, 106.1):
        assert not standstill.outlived_by(wall_ns(sent), 106.6), sent
    assert standstill.outlived_by(wall_ns(106.55), 106.6)
    standstill.passed(116.2, wall_ns(116.2))
    assert standstill.outlived_by(wall_ns(106.1), 116.2)


def test_a_standstill_long_ago_is_forgotten() -> None:
    """A command that seems to come from a stall that ended 98 s ago is not refused.

    A command cannot be in transit for that time, so the sender's clock must be wrong.
    """
    standstill = resumed(3.0)
    stalls_again(standstill, 200.0, 201.0)
    standstill.passed(201.3, wall_ns(201.3))
    assert not standstill.outlived_by(wall_ns(200.5), 201.3)
    assert standstill.outlived_by(wall_ns(102.0), 201.3)


def test_a_command_that_was_sent_shortly_before_the_standstill_waited_as_well() -> None:
    """A command that was sent just before a stall is refused, because it waited during the stall.

    The driver's process receives the command only after the stall.
    """
    standstill = resumed(3.0)
    standstill.passed(103.4, wall_ns(103.4))
    assert not standstill.outlived_by(wall_ns(99.9), 103.4)


def test_a_command_that_seems_to_be_sent_at_the_end_of_the_standstill_may_be_from_before() -> None:
    """A command is refused if its stamp is 1 ms after the end of a stall.

    The sender's clock is known only roughly, so the command may be from the time of the stall.
    """
    standstill = resumed(3.0)
    standstill.passed(103.4, wall_ns(103.4))
    assert not standstill.outlived_by(wall_ns(103.001), 103.4)


def test_a_command_sent_during_the_standstill_is_never_fresh() -> None:
    """A command is sent during a stall and arrives seconds later. It is refused.

    Ten seconds after the stall, all commands are accepted again.
    """
    standstill = resumed(5.0)
    standstill.passed(108.0, wall_ns(108.0))
    assert not standstill.outlived_by(wall_ns(104.9), 108.0)
    assert standstill.outlived_by(wall_ns(105.5), 108.0)
    standstill.passed(116.0, wall_ns(116.0))
    assert standstill.outlived_by(wall_ns(104.9), 116.0)


@pytest.mark.parametrize("step_s", [-3600.0, -4.0, -1.0, 1.0, 4.0, 3600.0])
def test_a_step_of_the_clock_after_a_standstill_makes_nothing_fresh_and_nothing_old(
    step_s: float,
) -> None:
    """The computer's clock is set forward or back after a stall.

    Commands from the stall are still refused, and new ones are accepted.
    """
    standstill = resumed(3.0)
    standstill.passed(103.5, wall_ns(103.5))
    standstill.passed(103.6, wall_ns(103.6 + step_s))
    assert standstill.outlived_by(wall_ns(103.59 + step_s), 103.6)
    assert not standstill.outlived_by(wall_ns(102.0 + step_s), 103.6)
    standstill.begun(105.0)  # the steady clock gives the times of both stalls
    standstill.passed(105.0, wall_ns(105.0 + step_s))
    standstill.passed(105.4, wall_ns(105.4 + step_s))
    for sent in (102.0, 103.3, 104.9):
        assert not standstill.outlived_by(wall_ns(sent + step_s), 105.4), sent
    assert standstill.outlived_by(wall_ns(105.39 + step_s), 105.4)


@pytest.mark.parametrize("skew_s", [-1e6, 1e6])
def test_with_a_wrong_clock_at_the_sender_only_what_comes_at_once_is_suspect(skew_s: float) -> None:
    """The sender's clock is wrong by days. Its commands are refused right after a stall.

    A second later, its commands are accepted again.
    """
    standstill = resumed(5.0)
    assert not standstill.outlived_by(wall_ns(104.9 + skew_s), 105.0 + SETTLE_S / 2)
    standstill.passed(106.0, wall_ns(106.0))
    assert standstill.outlived_by(wall_ns(105.9 + skew_s), 106.0)


def test_whenever_the_guard_steps_in_the_driver_notices() -> None:
    """The driver notices each stall that makes the guard process act.

    Otherwise, the driver would send motion commands while the guard process sends stop bytes.
    """
    assert 3 * BEAT_S < STANDSTILL_S < LIMIT_S
