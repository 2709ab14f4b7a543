# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the envelope: the set of velocities that a robot may have after its recent set-points.

A set-point that was replaced has less and less effect on the envelope.
"""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import twists

from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.motion_monitor.envelope import NOISE_MPS, on_the_way, outside
from omnibot_driver.core.motion_monitor.set_point_history import (
    AT_REST,
    FADED_S,
    HELD_S,
    SetpointHistory,
)
from omnibot_driver.core.motion_monitor.wind_up import MOST_M, WindUp

FORWARD = BodyTwist(0.4, 0.0, 0.0)


def plain(twist: BodyTwist) -> tuple[float, float, float]:
    return twist.vx_mps, twist.vy_mps, twist.yaw_rate_radps


@given(st.lists(st.tuples(twists, st.floats(0.0, 1.0)), min_size=1, max_size=6))
def test_what_lies_between_rest_and_the_set_points_is_inside(
    setpoints: list[tuple[BodyTwist, float]],
) -> None:
    """Any weighted mean of the recent set-points and zero velocity is inside the envelope."""
    weight = max(1.0, sum(part for _, part in setpoints))
    motion = BodyTwist(
        sum(part * each.vx_mps for each, part in setpoints) / weight,
        sum(part * each.vy_mps for each, part in setpoints) / weight,
        sum(part * each.yaw_rate_radps for each, part in setpoints) / weight,
    )
    hull = [plain(each) for each, _ in setpoints]
    for heading_known in (True, False):
        way_mps, turn_radps = outside(motion, hull, heading_known=heading_known)
        assert way_mps <= 0.0
        assert turn_radps <= 0.0


near_by = st.tuples(*[st.floats(-0.03, 0.03)] * 3)


@given(st.lists(twists, min_size=1, max_size=4), st.floats(0.0, 1.0), near_by)
def test_what_is_on_the_way_is_inside(
    setpoints: list[BodyTwist], part: float, off: tuple[float, float, float]
) -> None:
    """The shortcut ``on_the_way`` accepts no twist that the full computation (``outside``) rejects.

    With at most two set-points, the shortcut accepts every twist close to the line between them.
    """
    one, other = setpoints[0], setpoints[-1]
    x, y, yaw = off
    motion = BodyTwist(
        part * one.vx_mps + (1 - part) * other.vx_mps + x,
        part * one.vy_mps + (1 - part) * other.vy_mps + y,
        part * one.yaw_rate_radps + (1 - part) * other.yaw_rate_radps + yaw,
    )
    if on_the_way(motion, setpoints):
        assert max(outside(motion, [*map(plain, setpoints)], heading_known=True)) <= 0.0
    if len(setpoints) <= 2 and max(map(abs, off)) < 0.01:
        assert on_the_way(motion, setpoints)


@pytest.mark.parametrize("angle", [0.0, 0.1, 1.0, math.pi, -2.0])
def test_what_is_outside_is_so_by_its_distance_from_the_hull(angle: float) -> None:
    """A twist is outside the envelope.

    Its excess is its distance from the convex hull of the set-points, less a margin.
    """
    away = BodyTwist(-0.3 * math.cos(angle), -0.3 * math.sin(angle), 0.0)
    way_mps, turn_radps = outside(
        away, [(0.1 * math.cos(angle), 0.1 * math.sin(angle), 0.0)], heading_known=True
    )
    assert way_mps == pytest.approx(0.3 - math.hypot(NOISE_MPS, 0.01), rel=0.03)
    assert turn_radps < 0.0


def test_a_set_point_that_was_replaced_explains_less_and_less() -> None:
    """A replaced set-point allows its full velocity for 0.3 s, then less and less.

    It allows nothing later than 1.1 s after its replacement.
    """
    history = SetpointHistory()
    history.add(AT_REST, 0.0)
    history.add(FORWARD, 10.0)
    history.add(AT_REST, 20.0)
    speeds = [
        max(math.hypot(x, y) for x, y, _ in history.explained(20.0 + age_s))
        for age_s in (0.0, HELD_S, HELD_S + 0.2, FADED_S + 0.01)
    ]
    assert speeds == pytest.approx([0.4, 0.4, 0.4 / math.e, 0.0])
    assert history.explained(20.0 + FADED_S + 0.01) == [plain(AT_REST)]


def test_a_set_point_that_was_short_counts_as_well() -> None:
    """The envelope contains even a set-point that was valid only for a single tick.

    The set-point begins and ends between two displacements.
    """
    history = SetpointHistory()
    history.add(AT_REST, 0.0)
    history.add(FORWARD, 10.0)
    history.add(AT_REST, 10.01)
    assert plain(FORWARD) in history.explained(10.04)
    assert FORWARD in history.since(10.0)
    assert history.since(10.02) == [AT_REST]


def test_nothing_is_known_before_the_first_set_point() -> None:
    """The envelope is unknown until some time after the first set-point.

    It is also unknown for some time after a goal pose. While it is unknown, no motion is judged.
    """
    history = SetpointHistory()
    assert not history.known(0.0)
    history.add(AT_REST, 10.0)
    assert not history.known(10.5)
    assert history.known(10.9)
    history.add(None, 20.0)
    history.add(FORWARD, 30.0)
    assert not history.known(30.5)
    assert history.explained(30.9) == [plain(FORWARD)]


def test_the_history_does_not_grow_without_end() -> None:
    """A long ramp has a new set-point in each tick. The history of set-points stays short."""
    history = SetpointHistory()
    for tick in range(10_000):
        history.add(BodyTwist(1e-6 * tick, 0.0, 0.0), 0.01 * tick)
    assert len(history.since(-math.inf)) < 400


def test_a_held_robot_winds_up_by_what_it_loses() -> None:
    """The wind-up is the distance that a held robot may catch up later.

    The wind-up grows by 1.2 times the distance that the robot falls behind, up to a limit, and
    shrinks in normal motion.
    """
    wind_up = WindUp()
    for _ in range(10):
        wind_up.follow(AT_REST, 0.04, [FORWARD], heading_known=True)
    assert wind_up.way_m == pytest.approx(0.192)
    for _ in range(100):
        wind_up.follow(AT_REST, 0.04, [FORWARD], heading_known=True)
    assert wind_up.way_m == MOST_M
    for _ in range(1000):
        wind_up.follow(FORWARD, 0.04, [FORWARD], heading_known=True)
    assert wind_up.way_m < 1e-3


def test_a_robot_that_speeds_up_is_not_held() -> None:
    """A robot that is still at rest just after a command to drive is not regarded as held."""
    wind_up = WindUp()
    wind_up.follow(AT_REST, 0.04, [FORWARD, AT_REST], heading_known=True)
    assert wind_up.way_m == 0.0


def test_one_long_displacement_does_not_prove_that_a_robot_is_held() -> None:
    """A single displacement of zero over 0.1 s does not prove that a robot is held.

    The robot may have reversed its direction in this time. Two such displacements in a row prove
    that the robot is held.
    """
    wind_up = WindUp()
    wind_up.follow(AT_REST, 0.1, [FORWARD], heading_known=True)
    assert wind_up.way_m == 0.0
    wind_up.follow(AT_REST, 0.1, [FORWARD], heading_known=True)
    assert wind_up.way_m == pytest.approx(0.096)
    wind_up.pay(0.1, 0.0, 0.1)
    wind_up.follow(AT_REST, 0.1, [FORWARD], heading_known=True)
    assert wind_up.way_m == pytest.approx(0.086)


def test_what_is_made_good_is_paid_for() -> None:
    """A robot that was held or pushed may catch up a certain distance, the wind-up.

    Each distance beyond the set-points is subtracted from the wind-up, down to zero.
    """
    wind_up = WindUp()
    wind_up.carry(BodyTwist(0.0, 0.5, 0.0), 0.2)
    assert wind_up.pay(0.5, 0.0, 0.1)
    assert wind_up.way_m == pytest.approx(0.05)
    assert not wind_up.pay(0.5, 0.2, 0.1)
    assert wind_up.way_m == 0.0
