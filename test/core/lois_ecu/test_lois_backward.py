# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Odometry of wheels that turn backward. The public firmware does not count backward ticks."""

import math
from dataclasses import replace
from statistics import mean, median

import pytest
from lois_drives import HOST_GAINS, LATE_READS_S, drive, driven, motion, nominal, off_m, wrong

from omnibot_driver.core.lois_ecu import measured_speed
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.simulator.lois_ecu import Firmware
from omnibot_driver.simulator.lois_ecu.settings import MotorSettings

pytestmark = pytest.mark.slow

BOTH = pytest.mark.parametrize("firmware", ["documented", "firmware"])


@BOTH
def test_backward_its_way_is_within_3_percent_and_its_place_within_10(firmware: Firmware) -> None:
    """After a backward drive, the odometry's distance is right within 3 %.

    The mean error of the position is below 10 % of the distance, although the public firmware
    counts no ticks backward.
    """
    seeds = (1,) if firmware == "documented" else (1, 2)
    drives = [driven(firmware, "reverse", seed) for seed in seeds]
    for one in drives:
        assert one.way_m > 5.0
        way_m, true_m = (math.hypot(place.x_m, place.y_m) for place in (one.last.pose, one.true))
        assert way_m == pytest.approx(true_m, rel=0.03)
        assert one.sigmas < 3.0
    part = 0.02 if firmware == "documented" else 0.1
    assert mean(off_m(one) / one.way_m for one in drives) < part


def test_the_gains_of_the_boot_are_described_by_the_covariance() -> None:
    """With the boot's gains, the right wheel stops, but the board still reports a speed for it.

    This makes the pose wrong. The covariance fits the error.
    """
    ours = LoisEcuSettings()
    names = {1000: "place right", 1003: "straight back", 1004: "curve back", 1001: "place right"}
    drives = [motion(wrong("firmware", seed), name, ours) for seed, name in names.items()]
    assert median(one.nees for one in drives) < 2.4
    assert max(one.sigmas for one in drives) < 3.5


def test_a_wheel_that_falls_to_its_set_point_and_stands_is_seen_and_started_again() -> None:
    """The odometry detects that a wheel has stopped, although the board still reports 20 RPM.

    Otherwise, the estimated heading would be wrong by 600°.
    """
    one = motion(nominal("firmware", 2020), "straight back", LoisEcuSettings())
    assert abs(one.error.yaw_rad) < math.radians(60)
    assert one.sigmas < 3.5


def test_a_wheel_that_the_driver_starts_again_has_not_rolled_before() -> None:
    """The odometry detects that a wheel was at rest before the driver started it again.

    The board still reported an old speed for this wheel. The odometry subtracts the distance that
    it has added since this speed last changed.
    """
    one = motion(wrong("firmware", 1046), "place right", LoisEcuSettings())
    assert abs(one.error.yaw_rad) < math.radians(30)
    assert one.sigmas < 3.5


def test_a_busy_computer_that_reads_several_reports_at_once_uses_all_of_them() -> None:
    """A busy computer reads several reports at once, every 0.05 to 0.35 s.

    The odometry uses all of these reports: skipped reports would hide wheels that stop.
    """
    one = motion(wrong("firmware", 1054), "straight back", LoisEcuSettings(), reads_s=LATE_READS_S)
    assert off_m(one) < 0.5 * one.way_m
    assert one.sigmas < 3.5


def test_a_wheel_that_was_found_at_rest_does_not_roll_because_the_heading_differs() -> None:
    """The odometry has found a wheel at rest, but the board's heading shows a turn.

    The odometry still assumes rest: the board computes this heading from an old speed of the wheel.
    """
    one = motion(wrong("firmware", 328), "place right", LoisEcuSettings(), reads_s=LATE_READS_S)
    assert abs(one.error.yaw_rad) < math.radians(40)
    assert one.sigmas < 3.5


@pytest.mark.parametrize("seed", [303, 334])
def test_the_covariance_of_a_turn_in_place_includes_the_delays_of_a_busy_computer(
    seed: int,
) -> None:
    """The covariance after a turn in place includes the heading error that a busy computer causes.

    Reads every 0.05 to 0.35 s make the heading wrong by up to 30°.
    """
    one = motion(wrong("firmware", seed), "place left", HOST_GAINS, reads_s=LATE_READS_S)
    assert one.sigmas < 4.0


@pytest.mark.parametrize(("name", "seed"), [("straight back", 9025), ("curve back", 9013)])
def test_backward_with_set_gains_the_way_is_within_10_percent(name: str, seed: int) -> None:
    """After a backward drive with the user's gains, the error of the position is small.

    It is below 10 % of the distance, although wheels overshoot or roll too fast.
    """
    one = motion(nominal("firmware", seed), name, HOST_GAINS)
    assert off_m(one) < 0.1 * one.way_m
    assert one.sigmas < 3.0


def test_wheels_that_roll_backward_at_twice_their_set_points_are_followed() -> None:
    """The distance is right within 3 % if wheels roll backward at twice the commanded speed.

    The board's odometry (0x20) shows the speed, although the firmware counts no ticks.
    """
    motors = MotorSettings(rpm_per_percent=1.1 * 0.97), MotorSettings(rpm_per_percent=1.1)
    one = motion(replace(nominal("firmware", 2), motors=motors), "reverse", HOST_GAINS)
    assert one.way_m > 11.0
    way_m, true_m = (math.hypot(place.x_m, place.y_m) for place in (one.last.pose, one.true))
    assert way_m == pytest.approx(true_m, rel=0.03)


def test_beyond_50_rpm_the_heading_of_0x20_is_worth_less(monkeypatch: pytest.MonkeyPatch) -> None:
    """Above 50 RPM, the board's own heading (0x20) leads to a larger yaw variance.

    At 62 RPM, some ticks follow each other so soon that the firmware measures no speed from them.
    """
    usual = nominal("firmware", 2)
    fast = replace(usual, motors=(MotorSettings(rpm_per_percent=1.1),) * 2)

    def variances() -> list[float]:
        """Return the yaw variances in rad² after two drives: at 62 RPM, and at 32 RPM."""
        drives = [drive(settings, [(6.0, (-25, -25))]) for settings in (fast, usual)]
        return [one.last.covariance.yaw_yaw for one in drives]

    ours = variances()
    monkeypatch.setattr(measured_speed, "LOST_TICKS", 0.0)
    grown = [one / before for one, before in zip(ours, variances(), strict=True)]
    assert grown[0] > 1.05
    assert grown[1] == 1.0
