# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Odometry of wheels that turn backward, which the public firmware does not count."""

import math
from dataclasses import replace
from statistics import mean, median

import pytest
from lois_drives import HOST_GAINS, drive, driven, motion, nominal, off_m, wrong

from omnibot_driver.core.lois_ecu import measured_speed
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.simulator.lois_ecu import Firmware
from omnibot_driver.simulator.lois_ecu.settings import MotorSettings

pytestmark = pytest.mark.slow

BOTH = pytest.mark.parametrize("firmware", ["documented", "firmware"])


@BOTH
def test_backward_its_way_is_within_3_percent_and_its_place_within_10(firmware: Firmware) -> None:
    """The robot drives backward. The public firmware then counts no ticks and reports integer RPM.

    So the estimated heading drifts. In eight drives, the error of the position is 4.9 % of the way
    on average, and 13 % at most.
    """
    drives = [driven(firmware, "reverse", seed) for seed in (1, 2, 3)]
    for one in drives:
        assert one.way_m > 5.0
        way_m, true_m = (math.hypot(place.x_m, place.y_m) for place in (one.last.pose, one.true))
        assert way_m == pytest.approx(true_m, rel=0.03)
        assert one.sigmas < 3.0
    part = 0.02 if firmware == "documented" else 0.1
    assert mean(off_m(one) / one.way_m for one in drives) < part


@pytest.mark.parametrize("name", ["place right", "straight back", "curve back"])
def test_the_gains_of_the_boot_are_described_by_the_covariance(name: str) -> None:
    """With the boot gains, the right wheel oscillates and comes to rest.

    The board then still reports the wheel's last speed. If the covariance is right, the normalised
    squared error of half of all drives is below 2.4. A few drives with the boot gains are far
    above.
    """
    seeds = range(1000, 1005)
    drives = [motion(wrong("firmware", seed), name, LoisEcuSettings()) for seed in seeds]
    assert median(one.nees for one in drives) < 2.4
    assert max(one.sigmas for one in drives) < 3.5


@pytest.mark.parametrize("seed", [2020, 9005])
def test_a_wheel_that_falls_to_its_set_point_and_stands_is_seen_and_started_again(
    seed: int,
) -> None:
    """A wheel is commanded 19 RPM backward. It slows from 41 to 20 RPM and then stops.

    The board still reports 20 RPM. An odometry that believed this report would turn by 600° in 15
    s.
    """
    one = motion(nominal("firmware", seed), "straight back", LoisEcuSettings())
    assert abs(one.error.yaw_rad) < math.radians(60)
    assert one.sigmas < 3.5


def test_a_wheel_that_the_driver_starts_again_has_not_rolled_before() -> None:
    """A wheel is commanded 7 RPM backward, and the board keeps reporting 12 RPM.

    The wheel is at rest, because a rolling wheel would become slower.
    """
    one = motion(wrong("firmware", 1046), "place right", LoisEcuSettings())
    assert abs(one.error.yaw_rad) < math.radians(30)
    assert one.sigmas < 3.5


@pytest.mark.parametrize(
    ("name", "seed"), [("straight back", 9001), ("straight back", 9025), ("curve back", 9013)]
)
def test_backward_with_set_gains_the_way_is_within_10_percent(name: str, seed: int) -> None:
    """The robot drives backward with the user's gains. In some drives a wheel overshoots at first.

    In others, it rolls at 46 RPM instead of 34. The odometry is still right within 10 % of the way.
    """
    one = motion(nominal("firmware", seed), name, HOST_GAINS)
    assert off_m(one) < 0.1 * one.way_m
    assert one.sigmas < 3.0


@pytest.mark.parametrize("seed", [2, 3])
def test_wheels_that_roll_backward_at_twice_their_set_points_are_followed(seed: int) -> None:
    """Too much feed-forward makes the wheels too fast backward.

    Report 0x20 shows the true speed, but the firmware counts no ticks. The estimated distance is
    still right within 3 %.
    """
    motors = MotorSettings(rpm_per_percent=1.1 * 0.97), MotorSettings(rpm_per_percent=1.1)
    one = motion(replace(nominal("firmware", seed), motors=motors), "reverse", HOST_GAINS)
    assert one.way_m > 11.0
    way_m, true_m = (math.hypot(place.x_m, place.y_m) for place in (one.last.pose, one.true))
    assert way_m == pytest.approx(true_m, rel=0.03)


def test_beyond_50_rpm_the_heading_of_0x20_is_worth_less(monkeypatch: pytest.MonkeyPatch) -> None:
    """At 62 RPM some ticks follow each other so soon that the firmware loses their speed.

    The filter therefore adds to the yaw variance. At 32 RPM it adds nothing.
    """
    usual = nominal("firmware", 2)
    fast = replace(usual, motors=(MotorSettings(rpm_per_percent=1.1),) * 2)

    def variances() -> list[float]:
        """Return the yaw variances in rad² after a drive at 62 RPM, and at 32 RPM."""
        drives = [drive(settings, [(6.0, (-25, -25))]) for settings in (fast, usual)]
        return [one.last.covariance.yaw_yaw for one in drives]

    ours = variances()
    monkeypatch.setattr(measured_speed, "LOST_TICKS", 0.0)
    grown = [one / before for one, before in zip(ours, variances(), strict=True)]
    assert grown[0] > 1.05
    assert grown[1] == 1.0
