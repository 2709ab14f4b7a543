# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that lost replies do not look like a failure of the robot."""

import math

import pytest
from mart_bench import MartBench
from mart_campaign import FIRMWARES

from omnibot_driver.core.mart.moment import Moment
from omnibot_driver.core.mart.relative_heading import RelativeHeading
from omnibot_driver.simulator.common.network import NetworkFaults
from omnibot_driver.simulator.mart import Firmware


def test_one_heading_does_not_show_that_the_heading_is_constant() -> None:
    """The first heading of a drive comes late. Only a second one can be equal to it."""
    heading = RelativeHeading()
    heading.begin(10.0, anew=True)
    heading.tell(-0.02, Moment(10.7, 10.7, 10.7), math.inf)
    assert heading.changed_s == heading.told_s == 10.7
    heading.tell(-0.02, Moment(11.3, 11.3, 11.3), math.inf)
    assert heading.changed_s == 10.7
    heading.tell(-0.03, Moment(11.4, 11.4, 11.4), math.inf)
    assert heading.changed_s == 11.4


@pytest.mark.slow
@pytest.mark.parametrize("firmware", FIRMWARES)
def test_a_network_that_loses_a_few_replies_does_not_look_like_a_stuck_robot(
    firmware: Firmware,
) -> None:
    """The network loses 3 % of the datagrams of some drives.

    The driver does not report that the robot stands still, or that the IMU is dead.
    """
    for seed in range(10):
        bench = MartBench(firmware, NetworkFaults(lose=0.03), seed=seed, motor_lag_s=0.1).ready()
        for _ in range(6):
            bench.command(0.3, 0.1, 1.2)
            bench.command(0.0, 0.0, 1.5)
        told = " ".join(bench.notices)
        assert "does not move" not in told, seed
        assert "IMU is dead" not in told, seed
