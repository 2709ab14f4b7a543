# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the speed limits: a limited command keeps its direction and is within every limit."""

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from strategies import any_twists, finite

from omnibot_driver.core.commands.limits import (
    SpeedLimits,
    require_finite,
    require_timely,
    shorten,
    slow,
)
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.geometry.twist import BodyTwist

limits = st.one_of(st.just(0.0), st.floats(1e-3, 200.0))
vectors = st.lists(finite, min_size=2, max_size=3)
ULPS = 1 + 1e-11


def same_direction(a: tuple[float, ...], b: list[float]) -> bool:
    """Return whether two vectors have the same direction, to nine digits.

    A vector of zeros fits any direction.
    """
    largest_a, largest_b = max(map(abs, a)), max(map(abs, b))
    if largest_a < 1e-290 or largest_b < 1e-290:
        return True
    unit_a, unit_b = [x / largest_a for x in a], [x / largest_b for x in b]
    return all(
        math.isclose(x, y, rel_tol=1e-9, abs_tol=1e-9) for x, y in zip(unit_a, unit_b, strict=True)
    )


@given(vectors, limits)
@example([1e308, 1e308], 0.5)
@example([1e308, -1e308, 1e308], 1.0)
@example([5e-324, 0.0], 0.5)
@example([1.7e308, 1.7e308, -1.7e308], 0.5)
def test_a_shortened_vector_keeps_its_direction_and_the_limit(
    vector: list[float], limit: float
) -> None:
    """A vector that is longer than the limit is shortened to the limit, and keeps its direction."""
    short = shorten(vector, limit)
    assert math.hypot(*short) <= limit * ULPS
    assert limit == 0 or same_direction(short, vector)
    if math.hypot(*vector) > limit:
        assert math.hypot(*short) == pytest.approx(limit)


@given(st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=3), limits)
def test_a_vector_within_the_limit_is_left_as_it_is(vector: list[float], limit: float) -> None:
    """A vector within the limit is not changed at all. A longer one is shortened to the limit."""
    length = math.hypot(*vector)
    if length <= limit / ULPS:
        assert shorten(vector, limit) == tuple(vector)
    elif length >= limit * ULPS:
        assert math.hypot(*shorten(vector, limit)) == pytest.approx(limit)


@given(vectors, limits)
@example([1e308, -1e308], 17.0)
def test_slowed_wheels_keep_their_ratio_and_the_limit(values: list[float], limit: float) -> None:
    """If a wheel is too fast, all wheels are slowed by one factor.

    The fastest wheel is then at the limit.
    """
    slowed = slow(values, limit)
    assert max(map(abs, slowed)) <= limit * ULPS
    assert limit == 0 or same_direction(slowed, values)
    if max(map(abs, values)) > limit:
        assert max(map(abs, slowed)) == pytest.approx(limit)


@given(any_twists)
def test_a_limited_twist_is_within_every_limit_and_points_the_same_way(twist: BodyTwist) -> None:
    """A limited linear velocity keeps its direction, and a limited yaw rate keeps its sign."""
    limited = SpeedLimits(linear_mps=0.5, angular_radps=0.7).twist(twist)
    assert math.hypot(limited.vx_mps, limited.vy_mps) <= 0.5 * ULPS
    assert abs(limited.yaw_rate_radps) <= 0.7
    assert same_direction((limited.vx_mps, limited.vy_mps), [twist.vx_mps, twist.vy_mps])
    assert limited.yaw_rate_radps * math.copysign(1, twist.yaw_rate_radps) >= 0


@given(any_twists)
def test_what_is_allowed_is_not_changed(twist: BodyTwist) -> None:
    """If ``allow`` accepts a twist, the limits do not change it.

    If ``allow`` does not accept a twist, the twist exceeds a limit.
    """
    limits = SpeedLimits(linear_mps=0.5, angular_radps=0.7)
    if limits.allow(twist):
        limited = limits.twist(twist)
        assert (limited.vx_mps, limited.vy_mps) == pytest.approx((twist.vx_mps, twist.vy_mps))
        assert limited.yaw_rate_radps == twist.yaw_rate_radps
    else:
        assert twist.faster_than(0.5 / ULPS, 0.7 / ULPS)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", [0, 1, 2])
def test_what_is_not_finite_is_never_allowed(bad: float, place: int) -> None:
    """A twist with infinity or NaN is rejected, even if the limits are infinite."""
    values = [0.0, 0.1, -0.1]
    values[place] = bad
    none = SpeedLimits(linear_mps=math.inf, angular_radps=math.inf)
    assert none.allow(BodyTwist(0.0, 0.1, -0.1))
    assert not none.allow(BodyTwist(*values))


def test_the_linear_speed_is_limited_as_a_vector_and_not_by_axis() -> None:
    """A velocity of (3, −4) m/s is commanded at a limit of 0.5 m/s.

    It becomes (0.3, −0.4) m/s, and the yaw rate stays the same.
    """
    limited = SpeedLimits().twist(BodyTwist(3.0, -4.0, 0.1))
    found = (limited.vx_mps, limited.vy_mps, limited.yaw_rate_radps)
    assert found == pytest.approx((0.3, -0.4, 0.1))


def test_wheels_are_limited_by_the_fastest() -> None:
    """One wheel is commanded at twice its limit. The rates of all three wheels are halved."""
    limited = SpeedLimits(wheel_radps=17.0).wheels((34.0, -17.0, 1.0))
    assert limited == pytest.approx((17.0, -8.5, 0.5))


def test_a_limit_of_zero_lets_nothing_through() -> None:
    """Limits of zero make linear velocity, yaw rate and wheel rates zero."""
    none = SpeedLimits(linear_mps=0.0, angular_radps=0.0, wheel_radps=0.0)
    assert none.twist(BodyTwist(1.0, -1.0, 1.0)) == BodyTwist(0.0, 0.0, 0.0)
    assert none.wheels((1.0, -2.0, 3.0)) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", [0, 1, 2])
def test_what_is_not_finite_is_refused_by_name(bad: float, place: int) -> None:
    """A cmd_vel with infinity or NaN in any place is rejected, and the message names cmd_vel."""
    values = [0.0, 1e308, -1.0]
    values[place] = bad
    with pytest.raises(CommandRefused, match=r"cmd_vel.*NaN or infinity"):
        require_finite("cmd_vel", values)


@given(st.lists(finite, max_size=4))
def test_what_is_finite_is_not_refused(values: list[float]) -> None:
    """A finite value is accepted, however large it is."""
    require_finite("wheel_cmd", values)


@given(any_twists, any_twists, st.floats(0.01, 10.0), st.floats(0.0, 0.05))
def test_a_velocity_changes_by_no_more_than_the_acceleration_allows(
    now: BodyTwist, wanted: BodyTwist, acceleration: float, duration_s: float
) -> None:
    """The linear velocity approaches the wanted velocity along a straight line.

    Independently of this, the yaw rate approaches the wanted yaw rate, within its own acceleration
    limit.
    """
    limits = SpeedLimits(linear_mps2=acceleration, angular_radps2=acceleration)
    now, wanted = limits.twist(now), limits.twist(wanted)
    after = limits.approach(now, wanted, duration_s)
    step = (after.vx_mps - now.vx_mps, after.vy_mps - now.vy_mps)
    way = [wanted.vx_mps - now.vx_mps, wanted.vy_mps - now.vy_mps]
    assert math.hypot(*step) <= acceleration * duration_s + 1e-12
    assert math.hypot(*step) < 1e-9 or math.isclose(
        step[0] * way[0] + step[1] * way[1], math.hypot(*step) * math.hypot(*way), rel_tol=1e-6
    )
    if math.hypot(*way) <= acceleration * duration_s:
        assert (after.vx_mps, after.vy_mps) == (wanted.vx_mps, wanted.vy_mps)
    turn = wanted.yaw_rate_radps - now.yaw_rate_radps
    assert abs(after.yaw_rate_radps - now.yaw_rate_radps) == pytest.approx(
        min(abs(turn), acceleration * duration_s)
    )


def test_an_acceleration_of_zero_is_not_a_limit() -> None:
    """An acceleration limit of 0 means no limit."""
    wanted = BodyTwist(0.5, -0.5, 0.5)
    assert SpeedLimits().approach(BodyTwist(-0.5, 0.5, -0.5), wanted, 0.0) == wanted


@pytest.mark.parametrize("age_s", [0.0, 0.5, -0.5])
def test_what_is_young_enough_is_not_refused(age_s: float) -> None:
    """At a timeout of 0.5 s, a stamp may be up to 0.5 s in the past or in the future."""
    require_timely("cmd_vel", age_s, 0.5)


@pytest.mark.parametrize(
    ("age_s", "said"), [(0.51, r"0\.51 s old"), (-3.0, r"is 3\.00 s in the future")]
)
def test_what_is_too_old_or_from_the_future_is_refused_with_its_age(
    age_s: float, said: str
) -> None:
    """A command whose stamp is too old, or too far in the future, is refused.

    The refusal contains the stamp's age, and says that the clocks must agree.
    """
    with pytest.raises(CommandRefused, match=f"cmd_vel refused.*{said}.*clocks agree"):
        require_timely("cmd_vel", age_s, 0.5)
