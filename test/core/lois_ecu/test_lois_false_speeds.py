# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the odometry with reports that contain wrong speeds of a wheel.

The board also computes a wrong heading from these speeds.
"""

import math

import pytest

from omnibot_driver.core.lois_ecu import BoardOdometry, SetRpm, Ticks
from omnibot_driver.core.lois_ecu.odometry import LoisOdometry
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings

UNIT_MPS = 0.13 * math.tau / 60
TRACK_M = 0.47
PERIOD_S = 0.15


class Reports:
    """The driver's odometry for a robot with the public firmware, and the board's reports for it.

    Each test invents the reports.
    """

    def __init__(self) -> None:
        self.odometry = LoisOdometry(LoisEcuSettings())
        self._now = self._yaw_rad = self._x_m = 0.0
        self._ticks = [0, 0]
        self._last = BoardOdometry(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, appended=True)
        self.report((0, 0))
        self.report((0, 0))

    def order(self, left_rpm: int, right_rpm: int) -> None:
        self.odometry.wrote(SetRpm(left_rpm, right_rpm), self._now + 0.02)

    def report(
        self,
        rpm: tuple[int, int],
        ticks: tuple[int, int] = (0, 0),
        *,
        still: bool = False,
        passed_s: float = PERIOD_S,
    ) -> None:
        """Pass a tick report and an odometry report to the odometry.

        * ``rpm``: reported speeds of the left and the right wheel in RPM.
        * ``ticks``: newly counted ticks of the left and the right wheel.
        * ``still``: whether the board repeats its last odometry report.
        * ``passed_s``: time in s for which the board's pose moves at ``rpm``; unused if ``still``.
        """
        self._now += PERIOD_S
        left, right = (one * UNIT_MPS for one in rpm)
        along, turning = (left + right) / 2, (right - left) / TRACK_M
        if not still:
            self._yaw_rad += passed_s * turning
            self._x_m += passed_s * along * math.cos(self._yaw_rad)
            dx, dy = along * math.cos(self._yaw_rad), along * math.sin(self._yaw_rad)
            self._last = BoardOdometry(
                self._x_m, 0.0, self._yaw_rad, dx, dy, turning, appended=True
            )
        self._ticks = [old + new for old, new in zip(self._ticks, ticks, strict=True)]
        self.odometry.heard_ticks(Ticks(round(1e3 * self._now), *self._ticks), self._now)
        self.odometry.heard_odometry(self._last, self._now + 0.01)

    @property
    def ways_m(self) -> tuple[float, float]:
        """Estimated distances of the left and the right wheel in m."""
        self.odometry.predict(self._now + 0.02)
        return self.odometry._motion.way_m(0), self.odometry._motion.way_m(1)


@pytest.mark.parametrize("false_rpm", [-16, -54, -108])
def test_the_first_speed_of_a_wheel_that_starts_does_not_move_the_estimate(
    false_rpm: int,
) -> None:
    """The odometry does not follow the first reported speed of a starting wheel, which is too high.

    The board measures the pause before the first tick wrongly, because its timer wraps.
    """
    reports = Reports()
    reports.order(-12, 12)
    reports.report((0, 0), still=True)
    reports.report((0, 0), still=True)
    for right_rpm in (9, 13, 16):
        reports.report((false_rpm, right_rpm), (0, 2))
    reports.report((-4, 16), (0, 2))
    left_m, _ = reports.ways_m
    assert -0.06 < left_m <= 0.0


def test_the_turn_that_the_board_computes_for_a_pause_moves_no_wheel() -> None:
    """The right wheel starts while the board holds 11 RPM for the left wheel, which is at rest.

    The board computes a turn from this old speed. The odometry does not move the left wheel.
    """
    reports = Reports()
    reports.order(-12, 12)
    for rpm in ((0, 0), (0, 0), (0, 3), (-5, 9), (-9, 11), (-11, 12), (-12, 12), (-11, 12)):
        reports.report(rpm, (0, round(rpm[1] * PERIOD_S)), still=not any(rpm))
    reports.order(0, 0)
    reports.order(-16, 12)
    reports.report((0, 0))
    reports.report((-11, 0))
    for _ in range(2):
        reports.report((-11, 0), still=True)
    before_m, _ = reports.ways_m
    reports.report((-11, 0), (0, 1), passed_s=3 * PERIOD_S)
    assert reports.ways_m[0] == pytest.approx(before_m, abs=0.02)


def test_speeds_after_a_change_of_sign_show_how_far_a_wheel_rolls_out() -> None:
    """The set-point changes to backward. Reported speeds show how far the wheels roll forward.

    The board reports these speeds with the sign of the new set-point.
    """

    def way_m(rpms: tuple[int, int]) -> float:
        reports = Reports()
        reports.order(20, 20)
        for rpm in (0, 4, 12, 18, 20, 20, 20, 20, 20, 20):
            reports.report((rpm, rpm), (round(rpm * PERIOD_S),) * 2, still=not rpm)
        reports.order(-20, -20)
        for rpm in rpms:
            reports.report((-rpm, -rpm - 1))
        return sum(reports.ways_m) / 2

    assert way_m((19, 15)) > way_m((8, 5)) + 0.01


def test_wheels_that_roll_out_backward_do_not_move_forward_by_their_ticks() -> None:
    """After a change from backward to forward, ticks of coasting wheels count as backward motion.

    The board counts these ticks upward and reports forward speeds, but the wheels still roll
    backward.
    """
    reports = Reports()
    reports.order(-20, -20)
    for rpm in (0, 4, 12, 18, 20, 20, 21, 20, 21, 20):
        reports.report((-rpm, -rpm - 1), still=not rpm)
    before_m = sum(reports.ways_m) / 2
    reports.order(20, 20)
    for rpm in (18, 15, 11):
        reports.report((rpm, rpm + 1), (round(rpm * PERIOD_S),) * 2)
    assert sum(reports.ways_m) / 2 < before_m - 0.08
