# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the setting of the controller's clock."""

import calendar
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mart_bench import MartBench

from omnibot_driver.boards.mart_clock import clock_fields
from omnibot_driver.core.mart.jobs import Job


def test_the_setting_of_the_clock_gives_way_to_the_users_first_job() -> None:
    """A server has just appeared, and the driver wants to set its clock.

    A user's job comes first.
    """
    bench = MartBench()
    bench.open()
    bench.run_until(lambda: bench.board.resting, 30.0)
    bench.board.ask(Job.TIME, None, bench.now, *clock_fields(0.0, may_set_back=True))
    assert bench.job(Job.BIAS).success


def test_the_clock_is_set_while_the_robot_stands() -> None:
    """The driver sets the clock with TIME and six numbers, in UTC.

    During a drive it does not set the clock.
    """
    bench = MartBench().ready()
    assert bench.job(Job.TIME, 11, 22, 2026, 20, 15, 30).success
    assert b"TIME 11 22 2026 20 15 30" in bench.said()
    assert not bench.server.crashed
    bench.command(0.3, 0.0, 1.0)
    bench.board.ask(Job.TIME, "token", bench.now, 1, 1, 2027, 0, 0, 0)
    bench.command(0.3, 0.0, 1.0)
    assert b"TIME 1 1 2027 0 0 0" not in bench.said()


@given(st.floats(0.0, 4e9))
def test_after_a_drive_a_correct_clock_is_not_set_back(now_s: float) -> None:
    """After a drive, the driver never sets a correct clock back.

    The server ignores seconds: the current minute would set the clock back. So the driver sends the
    next full minute shortly before it begins.
    """
    fields = clock_fields(now_s, may_set_back=False)
    assert (fields is None) is (int(now_s) % 60 not in (56, 57, 58))
    if fields is not None:
        month, day, year, hour, minute, _second = fields
        set_s = calendar.timegm((year, month, day, hour, minute, 0))
        assert now_s + 1.0 < set_s < now_s + 4.1


def test_a_clock_that_may_be_set_back_is_set_at_once() -> None:
    """Before the first drive, the driver sets the server's clock (UTC) without waiting.

    The clock may then be set back. After a drive, this does harm, so TIME is sent only as a minute
    ends.
    """
    assert clock_fields(1_700_000_000.0, may_set_back=True) == (11, 14, 2023, 22, 13, 20)


def test_a_clock_that_is_set_back_between_two_drives_costs_one_start() -> None:
    """The user sets the server's clock back between two drives.

    RM (forward drive) computes the heading by this clock. So the second drive begins with an
    unusable heading and needs a second RM. One notice names the clock.
    """
    bench = MartBench("source").ready()
    assert bench.board.is_fresh
    bench.command(0.3, 0.3, 2.0)
    bench.run(2.0)
    assert not bench.board.is_fresh
    assert bench.job(Job.TIME, 1, 1, 1999, 0, 0, 0).success
    since = len(bench.written)
    bench.command(0.3, 0.3, 5.0)
    assert sum(data.startswith(b"RM ") for data in bench.said(since)) == 2
    assert bench.robot.board.facts["yaw_rate_radps"] == pytest.approx(0.3, rel=0.05)
    assert sum("clock" in notice for notice in bench.notices) == 1
    assert len(bench.notices) == 1
    bench.run(2.0)
    assert bench.error.way_m < 0.05
    assert abs(math.remainder(bench.error.yaw_rad, math.tau)) < 0.05
