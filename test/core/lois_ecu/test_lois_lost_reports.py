# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Odometry while reports of a LOIS ECU are lost on a bad line."""

import math

import pytest
from lois_drives import HOST_GAINS, USUAL_PERIODS_MS, Rig, nominal

from omnibot_driver.core.lois_ecu import BoardOdometry, SetRpm, Ticks, comparison
from omnibot_driver.core.lois_ecu.odometry import LoisOdometry
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings

pytestmark = pytest.mark.slow

UNIT_MPS = 0.13 * math.tau / 60
TRACK_M = 0.47


class Told:
    """The odometry of a robot with constant set-points. Each test invents the reports.

    ``rpm``: set-points of the left and the right wheel in RPM.
    """

    def __init__(self, rpm: tuple[int, int]) -> None:
        self.odometry = LoisOdometry(LoisEcuSettings(periods_ms=USUAL_PERIODS_MS))
        self._command, self._now = SetRpm(*rpm), 0.0
        self._x_m = self._y_m = self._yaw_rad = 0.0
        for _ in range(3):
            self.report(0.2, (0, 0))

    def report(self, after_s: float, rpm: tuple[int, int]) -> None:
        """Pass a report of these speeds in RPM to the odometry, ``after_s`` after the last one."""
        self._now += after_s
        left, right = (one * UNIT_MPS for one in rpm)
        along, turning = (left + right) / 2, (right - left) / TRACK_M
        self._yaw_rad += after_s * turning
        dx, dy = along * math.cos(self._yaw_rad), along * math.sin(self._yaw_rad)
        self._x_m, self._y_m = self._x_m + after_s * dx, self._y_m + after_s * dy
        self.odometry.heard_ticks(Ticks(round(1e3 * self._now), 0, 0), self._now)
        place = self._x_m, self._y_m, self._yaw_rad
        group = BoardOdometry(*place, dx, dy, turning, appended=True)
        self.odometry.heard_odometry(group, self._now + 0.01)
        self.odometry.wrote(self._command, self._now + 0.02)

    @property
    def yaw_stddev_deg(self) -> float:
        """Standard deviation of the heading at the last report, in degrees."""
        estimate = self.odometry.predict(self._now + 0.02)
        assert estimate is not None
        return math.degrees(math.sqrt(estimate.covariance.yaw_yaw))


def test_the_twist_of_a_silent_board_may_also_be_zero() -> None:
    """0.6 s after the last report, the variances of the twist begin to include a standstill.

    A silent board may have restarted, and a board that restarts has stopped.
    """
    odometry, now = LoisOdometry(LoisEcuSettings(periods_ms=USUAL_PERIODS_MS)), 0.0
    for report in range(20):
        now += 0.2
        odometry.heard_ticks(Ticks(round(1e3 * now), 4 * report, 4 * report), now)
        odometry.wrote(SetRpm(20, 20), now + 0.01)
    soon, late = odometry.predict(now + 0.3), odometry.predict(now + 1.0)
    assert soon is not None
    assert late is not None
    assert late.twist.vx_mps > 0.2
    assert soon.twist_covariance[0] < 0.1**2
    assert late.twist_covariance[0] >= late.twist.vx_mps**2
    assert late.twist_covariance[1] >= (late.twist.vx_mps / TRACK_M) ** 2


@pytest.mark.parametrize("gap_s", [0.6, 0.75])
def test_lost_reports_hardly_raise_the_uncertainty_of_a_steady_drive(gap_s: float) -> None:
    """In a steady drive, all reports are lost for up to 0.75 s.

    This gap adds less than 10° to the heading's standard deviation, and the heading's error is
    below 10°.
    """
    for phase in range(8):
        rig = Rig(nominal("firmware"), HOST_GAINS)
        rig.run(4.0 + 0.025 * phase)
        rig.order(-20, -24, 6.0)
        before_deg = math.degrees(math.sqrt(rig.outcome().last.covariance.yaw_yaw))
        rig._loss = 1.0
        rig.order(-20, -24, gap_s)
        rig._loss = 0.0
        rig.order(-20, -24, 1.0)
        one = rig.outcome()
        assert math.degrees(math.sqrt(one.last.covariance.yaw_yaw)) < before_deg + 10.0
        assert abs(one.error.yaw_rad) < math.radians(10.0)
        assert one.sigmas < 3.0


def test_a_set_point_that_changed_in_a_silence_may_not_have_arrived() -> None:
    """The line is interrupted in both directions. The user commands a stop, which does not arrive.

    So the robot drives on. The covariance includes the distance that it drives.
    """
    rig = Rig(nominal("firmware"), HOST_GAINS)
    rig.run(4.0)
    rig.order(-20, -20, 4.0)
    rig._loss = 1.0
    rig.order(0, 0, 1.0)
    rig._loss = 0.0
    rig.order(0, 0, 2.5)
    assert rig.outcome().sigmas < 3.0


def test_the_covariance_includes_that_a_wheel_may_be_at_rest_behind_lost_reports() -> None:
    """If most reports are lost, the heading's covariance allows for a wheel at rest.

    The board repeats the last speed of a wheel at rest, so a constant speed may mean rest.
    """
    told = Told((-10, -11))
    for rpm in ((-10, -11), (-10, -11), (-10, -11), (-11, -12)):
        told.report(0.5, rpm)
    for step in range(6):
        told.report(0.5, (-10 - step % 2, -12))
    assert told.yaw_stddev_deg > math.degrees(3.0 * 12 * UNIT_MPS / TRACK_M) / 2


@pytest.mark.parametrize(
    ("right_rpms", "more_deg"),
    [((-24, -24, -24, -24), 3.0), ((-32, -31, -18, -17), 8.0)],
    ids=["steady", "swinging"],
)
def test_a_gap_between_reports_leaves_the_way_in_it_uncertain(
    right_rpms: tuple[int, ...], more_deg: float
) -> None:
    """In a drive backward, a gap of 0.9 s between reports raises the heading's standard deviation.

    The increase is larger if a wheel's speed went up and down before the gap.
    """

    def grown_deg(gap_s: float) -> float:
        told = Told((-20, -24))
        for step in range(40):
            told.report(0.2, (-20 - step % 2, right_rpms[step % 4]))
        before_deg = told.yaw_stddev_deg
        told.report(gap_s, (-20, -24))
        return math.sqrt(told.yaw_stddev_deg**2 - before_deg**2)

    assert grown_deg(0.9) > grown_deg(0.2) + more_deg


def test_a_large_correction_by_the_heading_of_0x20_is_not_exact(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The covariance includes the error of a large correction by the board's heading (0x20).

    This correction is not exact, because a linear filter cannot follow starting wheels exactly.
    """

    def stddev_deg() -> float:
        told = Told((17, -17))
        for _ in range(2):
            told.report(0.2, (0, 0))
        told.report(0.5, (5, -18))
        return told.yaw_stddev_deg

    ours_deg = stddev_deg()
    monkeypatch.setattr(comparison, "CORRECTED_PART", 0.0)
    assert ours_deg > 1.5 * stddev_deg()
