# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Test of the variances of the twist of a LOIS robot that coasts after a stop."""

from statistics import mean
from typing import Any

import pytest
from lois_bench import FIRMWARE, Bench

from omnibot_driver.core.geometry.twist import BodyTwist

STOPS = 6
COASTS_S = 0.3
TICK_S = 0.01


def squared_errors(
    firmware: Any, vx_mps: float, yaw_rate_radps: float
) -> list[tuple[float, float]]:
    """Return the normalised squared errors of speed and yaw rate while the robot coasts.

    The robot stops several times, each time in another part of the controller's period.
    """
    bench, errors = Bench(firmware), []

    def command(twist: BodyTwist) -> None:
        bench.session.command_twist(twist, bench.now)
        bench.settle()

    for stop in range(STOPS):
        for _ in range(40):
            command(BodyTwist(vx_mps, 0.0, yaw_rate_radps))
            bench.run(0.1)
        bench.run(0.03 * stop)
        seen, truths = len(bench.odometry), []
        command(BodyTwist(0.0, 0.0, 0.0))
        for _ in range(round(COASTS_S / TICK_S)):
            bench.run(TICK_S)
            truths.append((bench.now, bench.board.truth))
        for told in bench.odometry[seen:]:
            stamp_s = told.stamp_s
            true = min(truths, key=lambda one: abs(one[0] - stamp_s))[1]
            assert told.twist is not None
            assert told.twist_variances is not None
            speed, turning = told.twist_variances
            errors.append(
                (
                    (told.twist.vx_mps - true.speed_mps) ** 2 / speed,
                    (told.twist.yaw_rate_radps - true.yaw_rate_radps) ** 2 / turning,
                )
            )
        bench.run(1.5)
    return errors


@pytest.mark.slow
@FIRMWARE
@pytest.mark.parametrize(("vx_mps", "yaw_rate_radps"), [(0.3, 0.0), (-0.3, 0.0), (0.0, 0.8)])
def test_the_variances_of_the_twist_are_honest_while_the_robot_coasts(
    firmware: Any, vx_mps: float, yaw_rate_radps: float
) -> None:
    """The variances of the twist allow for the unknown time at which the board cuts the power.

    After a Stop, the board cuts the power only at the next step of its controller.
    """
    errors = squared_errors(firmware, vx_mps, yaw_rate_radps)
    assert len(errors) >= 5 * STOPS
    for squares in zip(*errors, strict=True):
        assert mean(squares) < 1.5
        assert max(squares) < 5.0**2
