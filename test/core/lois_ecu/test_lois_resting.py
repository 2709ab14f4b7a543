# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Detection of a wheel that is at rest while the public firmware still reports its last speed."""

import pytest

from omnibot_driver.core.lois_ecu.resting import RestingWheel

GROUP_S = 0.1


def told(*speeds_rpm: float, tuned: bool = False) -> RestingWheel:
    """Return a detector that has received these speeds, one with each report."""
    wheel = RestingWheel()
    for rpm in speeds_rpm:
        wheel.tell(rpm, GROUP_S, tuned=tuned)
    return wheel


def test_a_speed_that_a_wheel_fell_to_and_keeps_is_that_of_a_wheel_that_stands() -> None:
    """The reported speed falls from 31 to 12 RPM, and then 12 RPM is repeated.

    The wheel is at rest.
    """
    assert told(31, 28, 19, 12).chance == 0.0
    assert 0.0 < told(31, 28, 19, 12, 12).chance < 1.0
    assert told(31, 28, 19, 12, 12, 12).chance == 1.0


def test_a_wheel_that_fell_rests_from_a_higher_speed_after_one_more_repetition() -> None:
    """The reported speed falls from 41 to 20 RPM and stays there.

    Few wheels stop from 20 RPM, so only the third repetition shows rest.
    """
    assert told(43, 41, 29, 20).chance == 0.0
    assert 0.0 < told(43, 41, 29, 20, 20).chance < 1.0
    assert 0.0 < told(43, 41, 29, 20, 20, 20).chance < 1.0
    assert told(43, 41, 29, 20, 20, 20, 20).chance == 1.0


def test_a_high_speed_that_is_kept_for_long_after_a_fall_is_measured_wrong() -> None:
    """The reported speed falls from 60 to 28 RPM and stays there, although no wheel is so steady.

    The board noticed a tick late, so the 28 RPM are wrong, and the wheel is at rest.
    """
    assert told(63, 60, 35, *[28] * 4).chance == 0.0
    assert 0.0 < told(63, 60, 35, *[28] * 6).chance < 1.0
    assert told(63, 60, 35, *[28] * 8).chance == 1.0
    assert told(63, 60, 35, *[28] * 20, tuned=True).chance == 0.0


def test_with_gains_that_the_user_set_it_is_never_certain() -> None:
    """With the user's gains, a wheel may overshoot: its speed falls, and it then rolls steadily.

    Its reported speeds are then like those of a wheel that comes to rest. So even twenty reports of
    the same speed after a fall do not prove that the wheel is at rest.
    """
    assert told(31, 28, 19, *[12] * 20, tuned=True).chance < 0.5


def test_a_steady_speed_is_that_of_a_wheel_that_rolls() -> None:
    """The reported speed never fell. The wheel rolls, however often its speed is repeated."""
    assert told(19, 20, *[20] * 50).chance == 0.0


def test_one_tick_that_came_late_is_not_a_fall() -> None:
    """The board notices a tick late. The next tick seems early: the speed is 27 RPM instead of 18.

    The 18 RPM after this single high speed are not a fall. The wheel has not stopped.
    """
    assert told(18, 18, 18, 27, 18, 18, 18).chance < 0.5


@pytest.mark.parametrize("rpm", [1, 3, 25, 40])
def test_a_wheel_that_starts_and_a_fast_one_do_not_rest(rpm: float) -> None:
    """The speed is below 4.5 or above 23.5 RPM, and is repeated three times.

    This does not show rest: few wheels come to rest from such a speed.
    """
    assert told(60, 58, 55, rpm, rpm, rpm, rpm).chance == 0.0


def test_another_speed_ends_the_rest() -> None:
    """A wheel was found to be at rest. Then its reported speed changes, which shows a new tick.

    The wheel is not at rest any more.
    """
    assert told(31, 28, 12, 12, 12, 2).chance == 0.0


def test_a_fall_that_was_not_told_is_seen() -> None:
    """While both wheels have the same speed, the board reports none. The driver estimates 28 RPM.

    Then the board reports 14 RPM several times. Compared with the estimate, the speed has fallen,
    so the wheel is at rest.
    """
    wheel = told(12)
    for rpm in (30.0, 28.0):
        wheel.note(rpm, GROUP_S)
    for _ in range(3):
        wheel.tell(14, GROUP_S)
    assert wheel.chance == 1.0
