# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Detection of a wheel that is at rest while the public firmware still reports its last speed."""

import pytest

from omnibot_driver.core.lois_ecu.resting import RestingWheel

GROUP_S = 0.1
GAP_S = 0.5
"""Time in s from one report to the next if most reports are lost."""


def told(*speeds_rpm: float, tuned: bool = False, every_s: float = GROUP_S) -> RestingWheel:
    """Return a detector that has received one report of each of these speeds, in this order."""
    wheel = RestingWheel()
    for rpm in speeds_rpm:
        wheel.tell(rpm, every_s, tuned=tuned)
    return wheel


def test_a_speed_that_a_wheel_fell_to_and_keeps_is_that_of_a_wheel_that_stands() -> None:
    """A wheel's reported speed falls to 12 RPM, and is then repeated twice.

    The detector is certain that the wheel is at rest: the board repeats the last speed of a stopped
    wheel.
    """
    assert told(31, 28, 19, 12).chance == 0.0
    assert 0.0 < told(31, 28, 19, 12, 12).chance < 1.0
    assert told(31, 28, 19, 12, 12, 12).chance == 1.0


def test_a_wheel_that_fell_rests_from_a_higher_speed_after_one_more_repetition() -> None:
    """A wheel's reported speed falls to 20 RPM, and is then repeated, as if the wheel had stopped.

    The detector is certain of rest only after three repetitions: wheels seldom stop directly from
    20 RPM.
    """
    assert told(43, 41, 29, 20).chance == 0.0
    assert 0.0 < told(43, 41, 29, 20, 20).chance < 1.0
    assert 0.0 < told(43, 41, 29, 20, 20, 20).chance < 1.0
    assert told(43, 41, 29, 20, 20, 20, 20).chance == 1.0


def test_a_high_speed_that_is_kept_for_long_after_a_fall_is_measured_wrong() -> None:
    """A wheel's reported speed falls to 28 RPM, and is then repeated many times.

    The detector becomes certain that the wheel is at rest: the speed of a rolling wheel is never
    that steady.
    """
    assert told(63, 60, 35, *[28] * 4).chance == 0.0
    assert 0.0 < told(63, 60, 35, *[28] * 6).chance < 1.0
    assert told(63, 60, 35, *[28] * 8).chance == 1.0
    assert told(63, 60, 35, *[28] * 20, tuned=True).chance == 0.0


def test_with_gains_that_the_user_set_it_is_never_certain() -> None:
    """With the user's gains, twenty equal speeds after a fall of the speed do not prove rest.

    The wheel may overshoot: its speed falls, and then stays constant.
    """
    assert told(31, 28, 19, *[12] * 20, tuned=True).chance < 0.5


def test_a_steady_speed_is_that_of_a_wheel_that_rolls() -> None:
    """The board reports a speed of 20 RPM over fifty times, and never a higher speed.

    The detector assumes that the wheel rolls.
    """
    assert told(19, 20, *[20] * 50).chance == 0.0


def test_one_tick_that_came_late_is_not_a_fall() -> None:
    """A late tick makes the board report 27 RPM once, among reports of 18 RPM.

    The detector does not take the change from 27 to 18 RPM for the stop of a wheel.
    """
    assert told(18, 18, 18, 27, 18, 18, 18).chance < 0.5


@pytest.mark.parametrize("rpm", [1, 3, 25, 40])
def test_a_wheel_that_starts_and_a_fast_one_do_not_rest(rpm: float) -> None:
    """Three repetitions of a speed below 4.5 or above 23.5 RPM do not show rest.

    The board repeats a stopped wheel's last speed, which is rarely so low or so high.
    """
    assert told(60, 58, 55, rpm, rpm, rpm, rpm).chance == 0.0


def test_another_speed_ends_the_rest() -> None:
    """A wheel at rest is no longer regarded as at rest when its reported speed changes.

    The change shows that the board has noticed a new tick.
    """
    assert told(31, 28, 12, 12, 12, 2).chance == 0.0


def test_a_fall_that_was_not_told_is_seen() -> None:
    """The driver estimates 28 RPM for a wheel, and then the board reports 14 RPM three times.

    The fall and the repetitions prove that the wheel is at rest: the board repeats the last speed
    of a stopped wheel.
    """
    wheel = told(12)
    for rpm in (30.0, 28.0):
        wheel.note(rpm, GROUP_S)
    for _ in range(3):
        wheel.tell(14, GROUP_S)
    assert wheel.chance == 1.0


def test_a_fall_in_gaps_between_reports_is_seen() -> None:
    """Most reports of a wheel's falling speed are lost.

    After a fall to 9 RPM and two repetitions, the detector is certain of rest: the board repeats
    the last speed of a stopped wheel.
    """
    assert 0.5 < told(26, 25, 17, 9, 9, every_s=GAP_S).chance < 1.0
    assert told(26, 25, 17, 9, 9, 9, every_s=GAP_S).chance == 1.0


def test_a_smaller_fall_is_the_end_of_a_fall_if_reports_are_lost() -> None:
    """Most reports are lost. A wheel's reported speed falls by 6 RPM, and is then repeated once.

    The wheel is probably at rest: this small fall may end a larger one that began in a gap.
    """
    assert told(17, 17, 16, 12, 12, every_s=GAP_S).chance < 0.2
    assert told(19, 18, 18, 12, 12, every_s=GAP_S).chance > 0.5
    assert told(19, 18, 18, 12, 12, every_s=GROUP_S).chance < 0.2


def test_a_speed_that_comes_again_and_again_between_gaps_is_that_of_a_wheel_that_stands() -> None:
    """If most reports are lost, eleven equal speeds make the detector certain of a wheel's rest.

    Without losses, equal speeds alone show no rest, because the reports would show the wheel slow
    down.
    """
    speeds = (13, 13, 13, 14)
    assert 0.0 < told(*speeds, 14, every_s=GAP_S).chance < 0.2
    assert 0.4 < told(*speeds, *[14] * 5, every_s=GAP_S).chance < 1.0
    assert told(*speeds, *[14] * 10, every_s=GAP_S).chance == 1.0
    assert told(*speeds, *[14] * 10).chance == 0.0
    assert told(*speeds, *[14] * 10, every_s=GAP_S, tuned=True).chance == 0.0


def test_reports_that_are_read_late_are_not_lost() -> None:
    """If reports are late but not lost, a wheel with a nearly constant speed is assumed to roll.

    No report shows a fall of the speed, and no report is missing. So the wheel has not stopped.
    """
    wheel = told(13, 13, 13)
    for _ in range(10):
        for since_s in (0.4, 0.0, 0.0):
            wheel.tell(14, since_s)
    assert wheel.chance == 0.0
