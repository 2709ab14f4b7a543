# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of odometry after a stall of the driver, when the lines of seconds are read together."""

import pytest
from fejemis_bench import DRIVE, FRONT, Bench, nominal

from omnibot_driver.core.geometry.se2 import Pose

READ = 4095
"""Largest number of bytes that a read of a terminal returns."""


def true_pose(bench: Bench) -> Pose:
    truth = bench.robot.truth
    return Pose(truth.x_m, truth.y_m, truth.yaw_rad)


@pytest.mark.slow
@pytest.mark.parametrize("phase_s", [0.0, 0.03, 0.05, 0.07])
@pytest.mark.parametrize("stall_s", [3.3, 4.5])
def test_the_motion_of_a_stall_is_in_odom(stall_s: float, phase_s: float) -> None:
    """The robot drives a curve while the driver stalls. Nothing is lost, but lines are too old.

    So the first displacement covers seconds, and the next one 20 ms, at the same speed.
    """
    bench = nominal()
    origin, begin = bench.odometry[-1].pose, true_pose(bench)
    bench.drive_on(0.3, 0.2, 2.0)
    bench.run(phase_s)
    held = {DRIVE: b"", FRONT: b""}
    for _ in range(round(stall_s / bench.robot.tick_s)):
        bench.now += bench.robot.tick_s
        for channel, data in bench.robot.advance():
            held[channel] += data
    bench.session.stood_still(stall_s, bench.now)
    while any(held.values()):
        for channel, data in held.items():
            bench.session.inbound.receive(data[:READ], bench.now, channel)
            bench.settle()
            bench.now += 0.0005
            held[channel] = data[READ:]
    bench.run(2.0)
    off = origin.way_to(bench.odometry[-1].pose) - begin.way_to(true_pose(bench))
    assert off.way_m < 0.01
    assert abs(off.yaw_rad) < 0.01
    assert not any("implausible" in notice for notice in bench.notices)
