# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the detection of a silent board. A stall of this process is not a silence."""

import math

import pytest

from omnibot_driver.core.liveness import Liveness
from omnibot_driver.core.traits import Traits

UNHEARD_S, SILENCE_S = 0.5, 2.0


@pytest.fixture
def liveness() -> Liveness:
    made = Liveness(
        Traits(
            imu_period_s=None,
            authorities=frozenset(),
            requests=frozenset(),
            unheard_s=UNHEARD_S,
            silence_s=SILENCE_S,
        )
    )
    made.begin(10.0)
    return made


def test_a_silence_is_found_once(liveness: Liveness) -> None:
    """The board sends nothing.

    The silence is reported once, as soon as the limit of 2 s has passed.
    """
    assert [liveness.fell_silent(now) for now in (11.9, 12.0, 12.1, 99.0)] == [
        False,
        True,
        False,
        False,
    ]


def test_a_silence_after_a_reading_is_another_one(liveness: Liveness) -> None:
    """The board falls silent, which is reported. Then a reading arrives.

    The next silence is a new one. It is reported too, after 2 s without data.
    """
    assert liveness.fell_silent(12.0)
    liveness.heard_at = 20.0
    assert not liveness.fell_silent(21.9)
    assert liveness.fell_silent(22.0)


def test_a_new_line_ends_a_silence(liveness: Liveness) -> None:
    """The line is opened again after a silence. The board has 2 s again to send data."""
    assert liveness.fell_silent(12.0)
    liveness.begin(12.0)
    assert liveness.wake_at(driven=False) == 14.0


def test_a_stall_is_not_a_silence_of_the_board(liveness: Liveness) -> None:
    """After a stall of this process, the board has 2 s again before it counts as silent.

    At the end of the stall, data of the board may still wait to be read.
    """
    liveness.stalled(50.0)
    assert not liveness.unheard(50.4)
    assert not liveness.fell_silent(51.9)
    assert liveness.fell_silent(52.0)


def test_a_known_silence_stays_known_through_a_stall(liveness: Liveness) -> None:
    """A silence that was reported before a stall is not reported again after the stall."""
    assert liveness.fell_silent(12.0)
    liveness.stalled(50.0)
    assert not liveness.fell_silent(99.0)
    assert liveness.wake_at(driven=False) == math.inf


def test_it_wakes_for_whichever_limit_comes_first(liveness: Liveness) -> None:
    """The driver must wake at the next limit for a silence of the board.

    * Driven robot: 0.5 s, when the driver ends the command.
    * Otherwise: 2 s, when the driver regards the board as silent.
    """
    assert liveness.wake_at(driven=False) == 12.0
    assert liveness.wake_at(driven=True) == 10.5
    assert liveness.unheard(10.5)
    assert not liveness.unheard(10.4)
