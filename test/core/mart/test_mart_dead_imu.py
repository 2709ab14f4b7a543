# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of an IMU that fails.

If it stays dead, the driver stops the robot, refuses motion and gives the reason.
"""

import pytest
from mart_bench import MartBench
from mart_campaign import FIRMWARES

from omnibot_driver.simulator.mart import Firmware, service_commands

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("firmware", FIRMWARES)
@pytest.mark.parametrize("wish", [(0.3, 0.0), (0.0, 0.5), "goal"])
def test_a_dead_imu_refuses_motion_until_it_is_back(
    firmware: Firmware, wish: tuple[float, float] | str
) -> None:
    """The IMU is dead. The driver starts no motor, and reports the reason.

    When the IMU works again, motion is allowed if the server has the command RST IMU.
    """
    bench = MartBench(firmware).ready()
    bench.server.imu.alive = False
    if isinstance(wish, str):
        bench.go_to(0.5, 0.5, 0.0)
        bench.run(3.0)
    else:
        bench.command(*wish, 3.0)
    assert bench.server.chassis.way_m == 0.0
    assert bench.server.chassis.yaw_rad == 0.0
    assert b"RM" not in {data.split()[0] for data in bench.said()}
    assert any("IMU" in notice for notice in bench.notices)
    assert "IMU" in bench.try_command(0.3, 0.0)
    bench.server.imu.alive = True
    bench.run(1.5)
    bench.command(0.3, 0.0, 2.0)
    assert bench.robot.stands is (firmware == "documented")


def test_one_failed_reset_of_the_imu_is_not_a_dead_imu() -> None:
    """RST IMU fails once, and the driver repeats it. Only a third failure would mean a dead IMU."""
    bench = MartBench("source").ready()
    bench.server.imu.alive = False
    bench.try_command(0.3, 0.0)
    bench.run_until(lambda: bench.server.imu.closed, 2.0)
    bench.run_until(lambda: not bench.server.busy, 2.0)
    bench.server.imu.alive = True
    bench.command(0.3, 0.0, 1.5)
    assert not bench.robot.stands
    assert bench.notices == []


@pytest.mark.parametrize(
    ("motion", "firmware"),
    [
        ((0.3, 0.0), "firmware"),
        # "source" reports headings only in forward drives
        ((0.3, 0.0), "source"),
        ((-0.2, 0.0), "firmware"),
        ((0.0, 0.5), "firmware"),
    ],
)
def test_an_imu_that_dies_while_the_robot_moves_stops_it_and_loses_the_server(
    motion: tuple[float, float], firmware: Firmware
) -> None:
    """The IMU dies in a motion.

    The driver stops the robot, and refuses motion until the server is restarted with a working IMU.
    """
    bench = MartBench(firmware).ready()
    bench.command(*motion, 2.5)
    assert not bench.robot.stands
    bench.server.imu.alive = False
    bench.command(*motion, 1.2)
    assert bench.robot.stands
    bench.run(6.0)
    assert any("heading does not change" in notice for notice in bench.notices)
    assert any(notice.startswith("server lost: ") for notice in bench.notices)
    assert bench.try_command(0.3, 0.0)
    bench.server.imu.alive = True
    bench.server.restart()
    bench.run(8.0)
    bench.command(0.3, 0.0, 2.0)
    assert not bench.robot.stands


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_a_robot_that_rolls_out_after_a_failed_move_does_not_move_without_a_command(
    firmware: Firmware,
) -> None:
    """The server reports a failed move at once, while the wheels still coast.

    The driver does not report the coasting as a motion without a command.
    """
    bench = MartBench(firmware, motor_lag_s=0.12).ready()
    bench.go_to(1.5, 0.0, 0.0)
    bench.run(2.4)
    bench.server.imu.alive = False
    bench.run(5.0)
    assert bench.robot.stands
    assert [notice for notice in bench.notices if "MPU6050 connection lost" in notice]
    assert not [notice for notice in bench.notices if "without a command" in notice]


def test_a_check_of_the_imu_that_is_too_fast_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    """The server answers RST IMU faster than it can check the IMU, so no motion starts.

    The driver says why, in its log and in the diagnostics, until a check succeeds.
    """
    bench = MartBench().ready()
    monkeypatch.setattr(service_commands, "RESET_S", 0.02)
    bench.command(0.3, 0.0, 6.0)
    assert bench.server.chassis.way_m == 0.0
    assert sum("answers RST IMU in less than" in each for each in bench.notices) == 1
    assert "RST IMU" in bench.session.figures(bench.now).board.trouble
    monkeypatch.undo()
    bench.command(0.3, 0.0, 3.0)
    assert not bench.robot.stands
    assert bench.session.figures(bench.now).board.trouble == ""
