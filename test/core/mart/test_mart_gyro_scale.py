# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of a controller whose gyro measures too little: ``odom_angular_scale`` corrects it."""

import math
from dataclasses import replace

import pytest
from mart_bench import MartBench

from omnibot_driver.boards import mart
from omnibot_driver.core.mart import MartSettings
from omnibot_driver.core.mart.moment import Moment
from omnibot_driver.core.mart.odometry import MartOdometry
from omnibot_driver.core.mart.states import Motion
from omnibot_driver.simulator.mart import Firmware

PART = 0.95
"""The part of each turn that the gyro measures."""


def bench_with_poor_gyro(firmware: Firmware, part: float = PART) -> MartBench:
    bench = MartBench(firmware, settings=MartSettings(heading_scale=1 / part))
    imu = bench.server.imu
    sample = imu.sample
    imu.sample = lambda rate_dps, now, *, integrates: sample(  # type: ignore[method-assign]
        part * rate_dps, now, integrates=integrates
    )
    return bench.ready()


def error_deg(bench: MartBench) -> float:
    return abs(math.degrees(bench.error.yaw_rad))


@pytest.mark.parametrize("firmware", ["documented", "firmware", "source"])
def test_a_scale_corrects_all_turns_that_the_gyro_measures(firmware: Firmware) -> None:
    """A gyro measures 95 % of each turn, and the scale is set to 1/0.95.

    The heading is right after a curve, a turn on the spot and a goal, and the goal needs only one
    turn.
    """
    bench = bench_with_poor_gyro(firmware)
    bench.command(0.2, 0.4, 10.0)
    bench.run(3.0)
    assert error_deg(bench) < 1.5
    bench.command(0.0, 0.5, 12.0)
    bench.run(3.0)
    assert error_deg(bench) < 3.0
    here = bench.odometry[-1].pose
    bench.go_to(here.x_m, here.y_m, here.yaw_rad + math.radians(160.0))
    bench.run(15.0)
    assert error_deg(bench) < 4.0
    turns = [said for said in bench.said() if said.startswith(b"MCL")]
    assert len(turns) == 1
    assert bench.odometry[-1].pose.yaw_rad - here.yaw_rad == pytest.approx(2.79, abs=0.1)


def test_a_gyro_that_measures_half_of_each_turn_makes_no_turn_seem_late() -> None:
    """The gyro measures half of each turn, so the driver requests half of each angle.

    A turn to a goal does not seem to last too long, and the heading stays certain.
    """
    bench = bench_with_poor_gyro("firmware", 0.5)
    here = bench.odometry[-1].pose
    bench.go_to(here.x_m, here.y_m, here.yaw_rad + 2.6)
    bench.run(20.0)
    assert bench.odometry[-1].pose.yaw_rad - here.yaw_rad == pytest.approx(2.6, abs=0.1)
    assert math.sqrt(bench.odometry[-1].covariance.yaw_yaw) < 0.1


def test_a_new_scale_during_a_curve_is_not_a_turn() -> None:
    """In a long curve the server's relative heading is 3600°. Then the scale changes by 10 %.

    Only the turn after the change is scaled: the heading does not jump by 360°.
    """
    odometry = MartOdometry(MartSettings())
    odometry.begin(Motion.REFERENCE, 0.0)
    odometry.started(0.1, sure=True)
    for number, degrees in enumerate((3600.0, 3600.0, 3602.0)):
        at_s = 1.0 + 0.1 * number
        moment = Moment(at_s, at_s, at_s)
        odometry.turned(degrees, moment)
        odometry.counted(100 * (number + 1), moment)
        odometry.settings = replace(odometry.settings, heading_scale=1.1)
    assert odometry.pose.yaw_rad == pytest.approx(math.radians(2.2))


def test_the_scale_of_angles_is_that_of_the_gyro_and_leaves_the_track_alone() -> None:
    """The user sets ``odom_angular_scale`` and inverts the heading.

    The angles of the gyro are scaled. The track width, which angles from the encoder need, stays
    the same.
    """
    values = mart.PARAMETERS.check_all({"odom_angular_scale": 1.05, "heading_inverted": True})
    settings = mart.settings(values)
    assert settings.heading_scale == pytest.approx(-1.05)
    assert settings.track_m == pytest.approx(0.40)
