# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of what the driver learns about motors that have no speed regulator."""

from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from omnibot_driver.core.mart import MartSettings
from omnibot_driver.core.mart.motor_line import MotorLine
from omnibot_driver.core.mart.speed_loop import SpeedLoop

SLOPES, DEAD = st.floats(0.6, 1.5), st.floats(0.0, 8.0)
STEP_S = 0.1


def test_before_anything_is_measured_a_motor_is_taken_for_ideal() -> None:
    """Before any measurement, the driver assumes that a motor turns at its nominal speed."""
    assert MotorLine().units(12.0) == 12.0


@given(SLOPES, DEAD)
def test_two_speeds_tell_a_third_one(slope: float, dead: float) -> None:
    """The driver measures two speeds.

    The line through them gives the motor's units for a third speed.
    """
    line = MotorLine()
    for units in (40.0, 40.0, 16.0, 40.0, 16.0):
        line.learn(units, slope * (units - dead))
    assert line.units(slope * (10.0 - dead)) == pytest.approx(10.0, abs=0.8)


@pytest.mark.slow
@given(SLOPES, st.floats(0.95, 1.0))
def test_a_motor_that_is_faster_than_expected_does_not_seem_slower_afterwards(
    slope: float, part: float
) -> None:
    """The driver measures a motor's speed too low at 26 units, then correctly at 14 units.

    The second measurement does not lower the speed that the driver expects at 14 units.
    """
    line = MotorLine()
    for _ in range(8):
        line.learn(18.0, slope * 18.0)
    line.learn(26.0, slope * part * 26.0)
    before = line.speed(14.0)
    line.learn(14.0, slope * 14.0)
    assert line.speed(14.0) >= min(before, slope * 14.0) - 0.01


@given(SLOPES, DEAD, st.floats(0.15, 1.0))
def test_a_turn_on_the_spot_is_right_after_a_drive_and_another_turn(
    slope: float, dead: float, rate_radps: float
) -> None:
    """After a drive and a turn on the spot were measured, the driver computes a second turn.

    The motors' units for the second turn are wrong by at most one.
    """
    settings = MartSettings()
    per_unit_mps = settings.speed_per_unit * slope
    loop, now = SpeedLoop(settings), 0.0
    loop.begin(45, False, now)
    for _ in range(30):
        now += STEP_S
        loop.measured((45 - dead) * per_unit_mps * STEP_S, 0.0, STEP_S, now)
    for wanted_radps in (0.5, rate_radps):
        units = loop.spin_units(wanted_radps)
        turned_radps = 2 * max(0.0, units - dead) * per_unit_mps / settings.track_m
        loop.spun(units, turned_radps)
    one_unit_radps = 2 * per_unit_mps / settings.track_m
    assert abs(turned_radps - rate_radps) <= one_unit_radps


@given(st.lists(st.tuples(st.floats(1.0, 127.0), st.floats(0.0, 400.0)), max_size=40))
def test_whatever_is_measured_the_units_rise_with_the_speed(
    measured: list[tuple[float, float]],
) -> None:
    """Whatever speeds the driver has measured, the motor needs more units for a higher speed.

    The computed units are between 0 and 200, before the driver limits them to 127.
    """
    line = MotorLine()
    for units, speed in measured:
        line.learn(units, speed)
    assert 0.0 < line.units(5.0) < line.units(50.0) < 200.0


@pytest.mark.slow
@settings(max_examples=25)
@given(SLOPES, DEAD, st.integers(0, 1000))
def test_a_long_straight_drive_leaves_the_other_speeds_of_the_line_as_they_were(
    slope: float, dead: float, seed: int
) -> None:
    """In a long straight drive, the driver measures one noisy speed of a motor again and again.

    The computed units for another, lower speed change by at most 3.
    """
    random, line = Random(seed), MotorLine()
    for units in (40.0, 12.0, 40.0, 12.0):
        line.learn(units, slope * max(0.0, units - dead))
    for _ in range(3000):
        line.learn(40.0, slope * (40.0 - dead) + random.gauss(0.0, 0.3))
    assert line.units(slope * (15.0 - dead)) == pytest.approx(15.0, abs=3.0)


def test_a_wheel_that_stands_although_it_should_turn_gets_more_units() -> None:
    """One wheel does not turn although the robot drives.

    Within a second, the driver gives the motor of this wheel more units.
    """
    loop, now = SpeedLoop(MartSettings()), 0.0
    loop.begin(4, False, now)
    loop.changed(30, 2, now)
    for _ in range(10):
        now += STEP_S
        loop.measured(0.133 * STEP_S, 0.66 * STEP_S, STEP_S, now)
    change = loop.change(0.14, 0.5, now)
    assert change is not None
    assert change[1] >= 3


def test_a_start_that_moved_nothing_is_followed_by_one_with_three_times_the_units() -> None:
    """After a start that moves nothing, the next start uses three times the units, up to 20.

    20 units move every robot that is not blocked.
    """
    loop = SpeedLoop(MartSettings())
    assert loop.first_units(0.1, 0.45) == 4
    for units, then in ((4, 12), (12, 20), (30, 20)):
        loop.begin(units, False, 0.0)
        loop.stood()
        assert loop.first_units(0.0, 0.0) >= then
    assert loop.first_units(0.0, 0.0) < 30
    assert loop.spin_units(0.1) > 12


CHANGES = st.lists(
    st.tuples(st.integers(-15, 15), st.integers(-15, 15), st.booleans()), min_size=1, max_size=3
)


@given(CHANGES)
def test_unanswered_changes_are_judged_by_the_measured_speeds(
    changes: list[tuple[int, int, bool]],
) -> None:
    """The measured speeds show which unanswered changes of the motors' units have arrived."""
    settings = MartSettings()
    loop, now = SpeedLoop(settings), 0.0
    loop.begin(50, False, now)
    true = [50, 50]
    for right, left, arrives in changes:
        loop.changed(right, left, now)
        loop.missed()
        true = [true[0] + right, true[1] + left] if arrives else true
    for _ in range(12):
        now += STEP_S
        right_mps, left_mps = (units * settings.speed_per_unit for units in true)
        turn_radps = (right_mps - left_mps) / settings.track_m
        loop.measured((right_mps + left_mps) / 2 * STEP_S, turn_radps * STEP_S, STEP_S, now)
    assert [loop._right.units, loop._left.units] == true


def test_a_balance_of_the_motors_is_believed_within_limits() -> None:
    """The driver assumes at most 8 % difference between the motors, even if it measures more.

    If the network duplicates a change of speed, equal motors look unequal.
    """
    loop = SpeedLoop(MartSettings())
    loop.begin(30, False, 0.0)
    for tick in range(100):
        loop.measured(0.01, -0.015, 0.05, tick * 0.05)
    assert loop.balance == pytest.approx(1.0 + 0.08)
    assert loop.left_over_right == pytest.approx(1.0 + 0.08)


@pytest.mark.parametrize(("reverse", "most"), [(True, 5), (False, 15)])
def test_a_change_that_nothing_may_show_to_have_come_twice_is_small(
    reverse: bool, most: int
) -> None:
    """On a slow network, one change is at most 15 motor units forward, and 5 backward.

    The network may deliver a change twice. The driver may not notice this if the robot drives
    backward.
    """
    loop = SpeedLoop(MartSettings())
    loop.trip_s = 0.05
    loop.begin(20, reverse, 0.0)
    assert loop.change(0.4, 0.0, 1.0) == (most, most)
