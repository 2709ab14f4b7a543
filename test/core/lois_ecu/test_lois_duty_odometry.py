# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Odometry of a LOIS robot driven by duty. The public firmware measures little of its motion."""

import math
from dataclasses import replace

import pytest
from lois_bench import Bench
from lois_drives import Drive, Program, Rig, nominal, off_m

from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.simulator.lois_ecu import MotorSettings

pytestmark = pytest.mark.slow

PUSH = (22.0, 22.0)
BACK = (-22.0, -22.0)
USUAL, SLOW = MotorSettings(), MotorSettings(time_constant_s=0.2)


def by_duty(program: Program, seed: int, motor: MotorSettings = USUAL) -> Drive:
    """Return the result of a drive by duty on the public firmware.

    ``program``: the steps of the drive, each with a duration and a set-point for each wheel.
    """
    settings = replace(nominal("firmware", seed), motors=(motor, motor))
    return Rig(settings, LoisEcuSettings(drive_mode="duty")).drive(program)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_forward_drive_that_the_firmware_does_not_count_is_in_the_odometry(seed: int) -> None:
    """Odometry includes a forward drive by duty in which the firmware counts no ticks.

    The board's own odometry (0x20) does not change in this drive. The driver does not conclude that
    the robot is at rest.
    """
    one = by_duty([(3.0, PUSH)], seed)
    assert one.way_m > 0.7
    assert off_m(one) < 0.25 * one.way_m
    assert one.sigmas < 3.0


def test_the_covariance_of_a_drive_just_after_stops_includes_that_of_the_duty_scale() -> None:
    """In a drive by duty just after Stops, the covariance includes the error of ``duty_scale``.

    This error has a standard deviation of 30 % for each wheel. Stops, which are duties of 0, do not
    reduce the error.
    """
    bench = Bench("firmware", LoisEcuSettings(drive_mode="duty"))
    assert bench.written[-1][1].startswith(b":0100000000")
    bench.drive_on(0.3, 3.0)
    last = bench.odometry[-1]
    assert last.pose.x_m > 0.5
    assert math.sqrt(last.covariance.xx) > 0.15 * last.pose.x_m


@pytest.mark.parametrize("own_periods", [False, True])
def test_a_report_just_after_a_stop_does_not_take_the_drive_back(*, own_periods: bool) -> None:
    """A report arrives while the wheels roll out after a duty drive. The driven distance is kept.

    Regression: half of the distance disappeared from the odometry.
    """
    ours = LoisEcuSettings(drive_mode="duty")
    for step in range(10):  # the report comes at another time after each stop
        rig = Rig(nominal("firmware", step), ours, own_periods=own_periods)
        one = rig.drive([(3.0 + 0.05 * step, PUSH)])
        assert off_m(one) < 0.1 * one.way_m
        assert one.sigmas < 1.0


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_duty_of_the_other_sign_brakes_the_wheels(seed: int) -> None:
    """The motors are slower than the driver assumes, and the duty changes from backward to forward.

    The forward duty brakes the wheels, and the odometry shows the braking.
    """
    one = by_duty([(3.0, BACK), (3.0, PUSH)], seed, SLOW)
    assert one.way_m > 1.4
    assert off_m(one) < 0.05
    assert one.sigmas < 2.0
