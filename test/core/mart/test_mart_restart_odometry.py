# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the odometry and its covariance if a MART server is restarted in a motion."""

import math
from itertools import pairwise

import pytest
from mart_bench import MartBench
from mart_campaign import FIRMWARES
from mart_goals import drops

from omnibot_driver.core.mart.states import State
from omnibot_driver.simulator.mart import Firmware

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("boot_s", "motion", "firmware"),
    [
        (boot_s, motion, FIRMWARES[(n + m) % 3])
        for n, boot_s in enumerate((0.05, 0.3, 1.0))
        for m, motion in enumerate(((0.2, 0.0), (-0.2, 0.0), (0.0, 0.5)))
    ],
)
def test_odometry_goes_on_if_the_server_is_restarted_while_the_robot_drives(
    boot_s: float, motion: tuple[float, float], firmware: Firmware
) -> None:
    """A restart during a drive does not undo the drive: the odometry adds it once.

    The restarted server answers the stop with "no motion", as if the drive had never started.
    """
    bench = MartBench(firmware).ready()
    bench.command(*motion, 3.0)
    bench.server.restart(boot_s)
    bench.command(*motion, 1.0)
    bench.run(5.0)
    assert bench.robot.stands
    assert bench.error.way_m < 0.1
    assert abs(bench.error.yaw_rad) < 0.25


@pytest.mark.parametrize(
    ("motion", "firmware"),
    [
        (motion, FIRMWARES[(n + m) % 3])
        for n, motion in enumerate(((0.2, 0.0), (0.3, 0.2), (-0.2, 0.0), (0.0, 0.5)))
        for m in range(2)
    ],
)
def test_odometry_goes_on_if_the_controller_is_switched_off_and_on_in_a_drive(
    motion: tuple[float, float], firmware: Firmware
) -> None:
    """If the controller loses its power for a second in a drive, the pose does not jump back.

    The encoder count and the heading begin at zero again.
    """
    bench = MartBench(firmware).ready()
    bench.command(*motion, 4.0)
    known = len(bench.odometry) - 1
    bench.robot.board.reboot()
    bench.command(*motion, 1.0)
    bench.run(5.0)
    assert bench.robot.stands
    poses = [estimate.pose for estimate in bench.odometry[known:]]
    assert max(one.way_to(other).way_m for one, other in pairwise(poses)) < 0.25
    error, noise = bench.error, bench.odometry[-1].covariance
    assert error.way_m < 0.2
    assert abs(error.yaw_rad) < math.sqrt(noise.yaw_yaw) + 0.05


@pytest.mark.parametrize(
    ("boot_s", "motion", "firmware"),
    [
        (boot_s, motion, FIRMWARES[(n + m) % 3])
        for n, boot_s in enumerate((0.05, 1.0, 4.0))
        for m, motion in enumerate(((0.3, 0.2), (-0.2, 0.2)))
    ],
)
def test_the_covariance_includes_the_unknown_turn_after_a_restart_in_a_curve(
    boot_s: float, motion: tuple[float, float], firmware: Firmware
) -> None:
    """After a restart in a curve, the covariance covers an error of the yaw of up to 80°.

    The motors run on, and the server's heading begins at zero, so the turn is not measured.
    """
    bench = MartBench(firmware).ready()
    bench.command(*motion, 5.0)
    bench.server.restart(boot_s)
    bench.command(*motion, 1.0)
    bench.run(boot_s + 4.0)
    error, noise = bench.error, bench.odometry[-1].covariance
    assert abs(error.yaw_rad) < math.sqrt(noise.yaw_yaw)
    assert error.way_m < 2.0 * math.sqrt(max(noise.xx, noise.yy))


def covers_the_turn(bench: MartBench) -> bool:
    """Return whether the covariance covers the error of the heading."""
    return abs(bench.error.yaw_rad) < 2.0 * math.sqrt(bench.odometry[-1].covariance.yaw_yaw)


@pytest.mark.parametrize("firmware", FIRMWARES)
@pytest.mark.parametrize(("drive_s", "boot_s"), [(1.2, 0.6), (3.0, 0.4), (3.0, 2.0)])
def test_the_covariance_includes_the_unknown_turn_if_the_command_ends_in_a_restart(
    drive_s: float, boot_s: float, firmware: Firmware
) -> None:
    """The server restarts in a curve, and the command ends before the server answers again.

    The driver does not take a small heading after the restart for a turn, and the covariance covers
    the error.
    """
    bench = MartBench(firmware).ready()
    bench.command(0.2, 0.3, drive_s)
    bench.server.restart(boot_s)
    bench.run(boot_s + 4.0)
    assert bench.robot.stands
    assert covers_the_turn(bench)


@pytest.mark.parametrize("firmware", FIRMWARES)
@pytest.mark.parametrize("boot_s", [0.2, 0.4])
def test_a_restart_before_the_last_heading_of_a_curve_is_not_taken_for_a_turn(
    boot_s: float, firmware: Firmware
) -> None:
    """The server stops a curve, and restarts before the driver reads the last heading.

    The driver does not take the new heading near zero for a turn, and the covariance covers the
    error.
    """
    bench = MartBench(firmware).ready()
    bench.command(0.2, 0.3, 3.0)
    bench.command_until(0.0, 0.0, lambda: bench.board._pilot.state is State.STILL)
    bench.server.restart(boot_s)
    bench.run(boot_s + 4.0)
    assert covers_the_turn(bench)


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_a_lost_reply_to_the_stop_of_a_curve_does_not_make_the_heading_unknown(
    firmware: Firmware,
) -> None:
    """The reply to a stop is lost, and the repeated stop finds no motion, as after a restart.

    But the heading continues, so the server was not restarted.
    """
    bench = MartBench(firmware).ready()
    bench.command(0.2, 0.3, 4.0)
    bench.command_until(0.0, 0.0, lambda: b"SRM" in bench.said()[-1:])
    gone = drops(bench.robot.network[0].from_board, lambda data: data == b"ok" and not gone)
    bench.run(4.0)
    assert gone
    assert abs(bench.error.yaw_rad) < 0.1
    assert bench.odometry[-1].covariance.yaw_yaw < 0.01
