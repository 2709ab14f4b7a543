# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of restarts that are hard to see, on a board that follows the manual.

The board's clock counts ns and wraps every 4.3 s. After a restart, clock and tick counts begin at
zero.
"""

import math
from itertools import pairwise
from typing import Any

import pytest
from lois_bench import Bench

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.lois_ecu.messages import SetDuty, Setting, Stream, Ticks
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.core.lois_ecu.translation import Translation

CLOCK_WRAPS_S = 2**32 / 1e9


def error(bench: Bench) -> tuple[float, float]:
    """Return the odometry's errors of position and heading, in m and rad."""
    truth: Any = bench.board.truth
    true, told = Pose(truth.x_m, truth.y_m, truth.yaw_rad), bench.odometry[-1].pose
    return true.way_to(told).way_m, abs(true.way_to(told).yaw_rad)


def restarts(bench: Bench) -> int:
    """Return how many restarts the driver has noticed."""
    board: Any = bench.session.board
    return int(board._ecu.translation.counts.restarts)


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [3.1, 3.7])
def test_a_restart_is_not_taken_for_wheels_that_roll_back(seconds: float) -> None:
    """The board restarts during a drive. Its tick counts and its clock begin at zero again.

    The odometry does not mistake the smaller counts for wheels that rolled back.
    """
    bench = Bench("documented")
    bench.drive_on(0.3, seconds)
    bench.board.reboot()
    bench.run(4.0)
    way_m, turn_rad = error(bench)
    assert way_m < 0.05
    assert turn_rad < 0.15


def begin_drive(bench: Bench, speed_mps: float, seconds: float, wrapped_for_s: float) -> None:
    """Drive for ``seconds``. The drive ends ``wrapped_for_s`` s after the board's clock wraps.

    If ``wrapped_for_s`` is negative, the drive ends before the clock wraps.
    """
    since_s = (bench.board.now_s + seconds) % CLOCK_WRAPS_S
    bench.run((wrapped_for_s - since_s) % CLOCK_WRAPS_S)
    bench.drive_on(speed_mps, seconds)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wrapped_for_s", "speed_mps"),
    [(-0.25, 0.3), (-0.06, -0.3), (0.06, 0.3), (0.25, -0.3)],
)
def test_a_restart_shows_although_the_clock_wraps_at_that_time(
    wrapped_for_s: float, speed_mps: float
) -> None:
    """The driver notices a restart although the board's clock wraps at about the same time.

    The odometry does not take the tick counts of zero for a motion backward.
    """
    bench = Bench("documented")
    begin_drive(bench, speed_mps, 2.4, wrapped_for_s)
    assert 20 < max(abs(wheel.ticks) for wheel in bench.board.wheels) < 70
    before = len(bench.odometry)
    bench.board.reboot()
    bench.run(3.0)
    assert restarts(bench) == 1
    poses = [estimate.pose for estimate in bench.odometry[before - 1 :]]
    assert max(a.way_to(b).way_m for a, b in pairwise(poses)) < 0.25
    way_m, turn_rad = error(bench)
    assert way_m < 0.05
    assert turn_rad < 0.15


@pytest.mark.slow
def test_a_restart_at_rest_shows_although_the_clock_wraps_at_that_time() -> None:
    """The board restarts at rest, shortly before its clock would wrap.

    The driver notices the restart, and the pose does not change.
    """
    bench = Bench("documented")
    begin_drive(bench, 0.3, 1.6, -2.0 - 0.15)
    bench.run(2.0)
    assert bench.board.standing
    assert max(wheel.ticks for wheel in bench.board.wheels) < 50
    place = bench.odometry[-1].pose
    bench.board.reboot()
    bench.run(3.0)
    assert restarts(bench) == 1
    assert place.way_to(bench.odometry[-1].pose).way_m < 0.02


def test_a_restart_that_the_clock_cannot_show_is_in_the_covariance() -> None:
    """The board restarts just when its clock wraps, so the driver cannot notice the restart.

    The covariance covers the resulting error of the odometry.
    """
    bench = Bench("documented")
    begin_drive(bench, 0.3, 1.3, 0.0)
    assert 5 < max(wheel.ticks for wheel in bench.board.wheels) < 30
    bench.board.reboot()
    bench.run(4.0)
    assert restarts(bench) == 0
    covariance = bench.odometry[-1].covariance
    assert error(bench)[0] < 2 * math.sqrt(covariance.xx + covariance.yy)


@pytest.mark.slow
@pytest.mark.parametrize("late_s", [0.0, 0.15])
def test_wheels_that_roll_back_while_the_clock_wraps_are_no_restart(late_s: float) -> None:
    """The wheels roll back until their tick counts are near zero just when the board's clock wraps.

    The driver does not take this for a restart. ``late_s``: how late a read at the wrap is, in s.
    """
    bench = Bench("documented")
    drive_s, back_s = 2.4, 2.6
    begin_drive(bench, 0.3, drive_s, -back_s)
    bench.drive_on(-0.3, back_s)
    assert max(abs(wheel.ticks) for wheel in bench.board.wheels) < 15
    if late_s:
        bench.stall(late_s)
    bench.drive_on(-0.3, 1.0)
    bench.run(2.0)
    assert restarts(bench) == 0
    assert error(bench)[0] < 0.05


@pytest.mark.slow
def test_a_restart_before_the_first_drive_is_noticed() -> None:
    """The board restarts before its first drive, when its tick counts are still zero.

    The driver notices the restart by the clock, and writes the gains again.
    """
    periods_ms = {Stream.TICKS: 400, Stream.ODOMETRY: 400}
    settings = LoisEcuSettings(written={Setting.LEFT_KP: 0.5}, periods_ms=periods_ms)
    bench = Bench("documented", settings)
    bench.run(4.0)
    bench.board.reboot()
    bench.run(4.0)
    assert restarts(bench) == 1
    assert bench.board.wheels[0].controller.gains.kp == pytest.approx(0.5)


PERIOD_S = 0.2
FAST_TICKS = 30
"""Ticks of a wheel in ``PERIOD_S`` at 150 RPM."""


def fast_wheels(steps: list[tuple[int, int]]) -> Translation:
    """Return a ``Translation`` that has received the reports of two fast wheels.

    In each of the first 20 reports, both counts grow by ``FAST_TICKS``. ``steps``: growth of the
    left and the right count in each later report.
    """
    settings = LoisEcuSettings(wheel_radius_m=0.03, drive_mode="duty", duty_scale=100.0)
    translation, counts, now = Translation(settings), [0, 0], 0.0
    for left, right in [(FAST_TICKS, FAST_TICKS)] * 20 + steps:
        duty = SetDuty(*(round(47 * math.copysign(1.0, way)) for way in (left, right)))
        translation.odometry.wrote(duty, now)
        now += PERIOD_S
        counts = [counts[0] + left, counts[1] + right]
        clock = round(now * 1e9) % 2**32
        translation.readings([Ticks(clock, *counts)], [now], "ns", now)
    return translation


@pytest.mark.parametrize("right", [-FAST_TICKS, FAST_TICKS])
def test_wheels_that_roll_back_fast_are_no_restart(right: int) -> None:
    """One wheel or both wheels roll back at 150 RPM, in duty mode.

    The driver does not take this for a restart, and the heading stays right.
    """
    slow = [(-FAST_TICKS // 2, right // 2)]
    translation = fast_wheels(slow + [(-FAST_TICKS, right)] * 22)
    assert translation.counts.restarts == 0
    expected_rad = 0.0 if right < 0 else 2 * 675 * math.tau / 60 * 0.03 / 0.47
    assert translation.odometry.yaw_rad == pytest.approx(expected_rad, abs=0.15)


def test_a_restart_of_a_board_with_fast_wheels_is_noticed() -> None:
    """The board restarts while its wheels roll at 150 RPM, and the driver notices the restart.

    The tick counts begin at zero again.
    """
    assert fast_wheels([(-596, -596), (2, 2)]).counts.restarts == 1
