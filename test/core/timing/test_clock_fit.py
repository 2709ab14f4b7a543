# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the fitted clock, with artificial upper and lower bounds of the ticks' times."""

from collections.abc import Callable

import pytest

from omnibot_driver.core.timing.clock_fit import ClockFit

PERIOD_S = 0.01
NEVER_BELOW = -1.0


def followed(
    skew: float, above: Callable[[int], float], below: Callable[[int], float], *, ticks: int = 2000
) -> tuple[ClockFit, float]:
    """Fit a clock to the ticks. Return the clock, and its error in s at the last tick.

    ``above``, ``below``: return the upper and the lower bound of the time of the tick with this
    number, relative to its true time, in s.
    """
    period_s = PERIOD_S * (1.0 + skew)
    line = ClockFit(PERIOD_S, (0, 1.0))
    for tick in range(ticks):
        true_s = tick * period_s
        line.see((tick, true_s + above(tick)), cut=False)
        line.not_before((tick, true_s + below(tick)))
    return line, line.at(ticks) - ticks * period_s


@pytest.mark.parametrize("skew", [1e-4, 0.0, -1e-4])
def test_without_bounds_from_below_the_least_delay_is_followed(skew: float) -> None:
    """Only upper bounds of the ticks' true times are known.

    The fitted clock follows the ticks with the smallest delay, and its slope is right.
    """
    line, late_s = followed(skew, lambda tick: tick % 7 * 1e-3, lambda _: NEVER_BELOW)
    assert late_s == pytest.approx(0.0, abs=1e-6)
    assert line.slope_s == pytest.approx(PERIOD_S * (1.0 + skew), rel=1e-6)


def test_between_near_bounds_the_middle_is_taken() -> None:
    """The fitted clock is near the middle of two close bounds.

    The bounds are 0.1 ms before and 0.8 ms after the true time. The fitted clock is 0.3 ms after
    the true time.
    """
    _, late_s = followed(0.0, lambda _: 0.8e-3, lambda _: -0.1e-3)
    assert late_s == pytest.approx(0.3e-3, abs=0.05e-3)


def test_bounds_that_keep_another_pace_do_not_bend_the_line_beyond_themselves() -> None:
    """For 8 s, the lower and upper bounds for the ticks' times drift by 0.1 ms/s from the truth.

    Nevertheless, the error of the fitted clock stays below 0.5 ms.
    """
    for skew in (1e-4, -1e-4):
        drift = [-skew * PERIOD_S * tick for tick in range(800)]
        start = 0.0 if drift[-1] > 0.0 else 0.87e-3
        _, late_s = followed(
            skew,
            lambda tick, drift=drift, start=start: start + drift[tick],  # type: ignore[misc]
            lambda tick, drift=drift, start=start: start + drift[tick] - 0.87e-3,  # type: ignore[misc]
            ticks=800,
        )
        assert abs(late_s) < 0.5e-3


def test_reads_that_were_late_do_not_lift_the_line() -> None:
    """Every twentieth read is late, so its lower bound for the time of the tick is too late.

    These wrong lower bounds do not make the fitted clock later.
    """
    for read_late_s in (0.9e-3, 5e-3):
        _, late_s = followed(
            0.0,
            lambda _: 1e-3,
            lambda tick, late_s=read_late_s: late_s if tick % 20 == 0 else -0.1e-3,  # type: ignore[misc]
        )
        assert late_s == pytest.approx(0.4e-3, abs=0.05e-3)


@pytest.mark.parametrize("late", [range(401), range(500, 901)])
def test_bounds_that_contradict_are_given_up_for_those_that_always_hold(late: range) -> None:
    """Late reads give lower bounds that contradict the upper bounds of other ticks.

    The clock discards the lower bounds, because upper bounds are always right.
    """
    _, late_s = followed(
        0.0,
        lambda tick: 0.9e-3 if tick in late else 0.0,
        lambda tick: 0.8e-3 if tick in late else -0.1e-3,
    )
    assert abs(late_s) < 0.2e-3
