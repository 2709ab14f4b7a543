# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Drives of a simulated LOIS robot with few or many encoder ticks per turn.

* Above about 1000 ticks per turn, the simulated board cannot control the wheels' speeds, so the
  tests command duties.
* The public firmware loses fast ticks, so its tests have at most 60 ticks per turn.
"""

import math
from typing import Literal

import pytest
from lois_bench import Bench, configure

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings


def true_pose(bench: Bench) -> Pose:
    truth = bench.board.truth
    return Pose(truth.x_m, truth.y_m, truth.yaw_rad)


def error_m(bench: Bench) -> float:
    """Return the distance in m between the true position and the position in the odometry."""
    return true_pose(bench).way_to(bench.odometry[-1].pose).way_m


def rejected(bench: Bench) -> int:
    """Return how many reports were rejected as implausible."""
    board = bench.session.board
    return int(board._ecu._decoder.group_statistics.implausible)


def restarts(bench: Bench) -> int:
    """Return how many restarts of the board the driver has noticed."""
    return int(bench.session.board._ecu.translation.counts.restarts)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("firmware", "per_turn", "mode", "speed_mps"),
    [
        *(("documented", per_turn, "rpm", 0.65) for per_turn in (12, 1000)),
        ("documented", 20_000, "duty", 0.2),
        ("firmware", 25, "rpm", 0.65),
    ],
)
def test_a_robot_with_such_encoders_drives_out_and_back(
    firmware: str, per_turn: int, mode: Literal["rpm", "duty"], speed_mps: float
) -> None:
    """With few or many encoder ticks, the odometry is right after a drive out and back.

    The error is at most 0.1 m or 3 sigma. No report is rejected, and only a real restart is
    noticed.
    """
    settings = LoisEcuSettings(ticks_per_revolution=per_turn, drive_mode=mode)
    bench = Bench(firmware, settings, steps=per_turn)
    bench.drive_on(speed_mps, 3.0)
    bench.drive_on(0.0, 0.6)
    bench.drive_on(-speed_mps, 3.5)
    bench.run(1.5)
    last = bench.odometry[-1]
    stddev_m = math.sqrt(last.covariance.xx + last.covariance.yy)
    assert error_m(bench) < (0.1 if firmware == "documented" else 3 * stddev_m)
    assert (rejected(bench), restarts(bench)) == (0, 0)
    bench.drive_on(speed_mps, 1.5)
    bench.run(2.5)  # the documented board's clock is then far from zero
    place = bench.odometry[-1].pose
    bench.board.reboot()
    bench.run(4.0)
    assert restarts(bench) == 1
    assert place.way_to(bench.odometry[-1].pose).way_m < 0.1
    assert not any("check `ticks_per_revolution`" in text for text in bench.notices)


@pytest.mark.slow
def test_a_new_resolution_applies_while_the_driver_runs() -> None:
    """A new ``ticks_per_revolution`` applies at once, while the driver runs.

    With the old, wrong value, reports of a fast wheel are rejected, and a notice names the
    parameter. With the new value, no report is rejected.
    """
    bench = Bench("documented", LoisEcuSettings(ticks_per_revolution=60), steps=1000)
    bench.drive_on(0.65, 3.0)
    assert rejected(bench) > 5
    assert sum("check `ticks_per_revolution`" in text for text in bench.notices) == 1
    bench.drive_on(0.0, 1.0)
    configure(bench, LoisEcuSettings(ticks_per_revolution=1000))
    bench.run(2.0)
    before, place, true_place = rejected(bench), bench.odometry[-1].pose, true_pose(bench)
    bench.drive_on(0.65, 3.0)
    bench.drive_on(0.0, 1.5)
    assert (rejected(bench), restarts(bench)) == (before, 0)
    way_m = place.way_to(bench.odometry[-1].pose).way_m
    assert way_m == pytest.approx(true_place.way_to(true_pose(bench)).way_m, abs=0.05)
    bench.drive_on(0.3, 2.0)
    assert bench.reset().message == "the board was reset"


@pytest.mark.slow
@pytest.mark.parametrize(("per_turn", "wrapped_for_s"), [(25, 0.15), (1000, -0.25)])
def test_a_restart_shows_although_the_clock_wraps(per_turn: int, wrapped_for_s: float) -> None:
    """The driver notices a restart of the board although the board's clock (in ns) wraps then.

    Just after a wrap, the clock is near zero, as after a restart.
    """
    bench = Bench("documented", LoisEcuSettings(ticks_per_revolution=per_turn), steps=per_turn)
    begin_drive(bench, wrapped_for_s)
    bench.board.reboot()
    bench.run(3.0)
    assert restarts(bench) == 1
    assert error_m(bench) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("per_turn", [25, 1000])
def test_a_drive_back_while_the_clock_wraps_is_no_restart(per_turn: int) -> None:
    """The robot drives back to its start, and a read is late just when the board's clock wraps.

    The driver does not take the low tick counts and the low clock for a restart.
    """
    bench = Bench("documented", LoisEcuSettings(ticks_per_revolution=per_turn), steps=per_turn)
    begin_drive(bench, -2.6)
    bench.drive_on(-0.3, 2.6)
    bench.stall(0.15)
    bench.drive_on(-0.3, 1.0)
    bench.run(2.0)
    assert restarts(bench) == 0
    assert error_m(bench) < 0.05


def begin_drive(bench: Bench, wrapped_for_s: float) -> None:
    """Drive for 2.4 s. At the end, the last wrap of the board's clock is ``wrapped_for_s`` ago."""
    wraps_s = 2**32 / 1e9
    bench.run((wrapped_for_s - bench.board.now_s - 2.4) % wraps_s)
    bench.drive_on(0.3, 2.4)
