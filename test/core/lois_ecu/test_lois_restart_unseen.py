# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of restarts of a documented board, whose clock in ns starts from zero, during a drive."""

from typing import Any

import pytest
from lois_bench import Bench

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.simulator.lois_ecu.sayings import Sayings


@pytest.fixture
def clock_from_zero(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the simulated board's clock start from zero with each boot."""
    real, began_s = Sayings.group, dict[Sayings, float]()

    def group(sayings: Sayings, code: int, clock_ms: int, now_s: float) -> bytes:
        return real(sayings, code, clock_ms, now_s - began_s.setdefault(sayings, now_s))

    monkeypatch.setattr(Sayings, "group", group)


def error(bench: Bench) -> tuple[float, float]:
    """Return the odometry's errors of position and heading, in m and rad."""
    truth: Any = bench.board.truth
    true, told = Pose(truth.x_m, truth.y_m, truth.yaw_rad), bench.odometry[-1].pose
    return true.way_to(told).way_m, abs(true.way_to(told).yaw_rad)


@pytest.mark.parametrize("seconds", [2.9, 3.0, 3.1, 3.4, 3.7, 4.0])
@pytest.mark.usefixtures("clock_from_zero")
def test_a_restart_is_not_taken_for_wheels_that_roll_back(seconds: float) -> None:
    """The board restarts during a drive. Its counts and its clock then have small values again.

    The odometry does not regard the smaller counts as wheels that rolled back.
    """
    bench = Bench("documented")
    bench.drive_on(0.3, seconds)
    bench.board.reboot()
    bench.run(4.0)
    way_m, turn_rad = error(bench)
    assert way_m < 0.2
    assert turn_rad < 0.4
