# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of ``calibrate scale``, which finds the scales of the board.

A scale is the number of the board's counts for 1 m/s or for 1 rad/s.
"""

import math
from pathlib import Path

import numpy as np
import pytest
from calibrate_rig import parameters_of, rig, row
from hypothesis import given, settings
from hypothesis import strategies as st

from omnibot_driver.boards.omnibot import PARAMETERS
from omnibot_driver.tools.calibrate import scale as scale_module
from omnibot_driver.tools.calibrate.log import Log
from omnibot_driver.tools.calibrate.scale import result
from omnibot_driver.tools.calibrate.speeds import SETTLE_S, plan, scale, speeds
from omnibot_driver.tools.needs import ToolError

UP, NO_BIAS = np.array([0.0, 0.0, -1.0]), np.zeros(3)
NOW = {name: parameter.default for name, parameter in PARAMETERS.by_name.items()}
ASSUMED = (70.0, 70.0, 500.0)


def drive(true: tuple[float, float, float], seed: int = 0, gyro: float = 1.0) -> Log:
    """Return the log of a drive that is planned for a board with the scales ``ASSUMED``.

    ``true``: the board's real scales. ``gyro``: factor on the measured yaw rate.
    """
    random = np.random.default_rng(seed)
    log, now_s, pose = Log(), 0.0, np.zeros(3)
    for seconds, command in plan((0.25, 0.25, 0.5), ASSUMED, 2, 1.0 + SETTLE_S):
        speed = np.array(command) * np.array(ASSUMED) / np.array(true)
        for tick in range(round(seconds / 0.01)):
            now_s += 0.01
            heading = pose[2]
            pose[:2] += 0.01 * np.array(
                [
                    math.cos(heading) * speed[0] - math.sin(heading) * speed[1],
                    math.sin(heading) * speed[0] + math.cos(heading) * speed[1],
                ]
            )
            pose[2] += 0.01 * speed[2]
            rate = -gyro * speed[2] + 0.001 * random.standard_normal()
            log.imu_rows.append((now_s, 0.0, 0.0, -9.8, 0.0, 0.0, rate))
            if tick % 2 == 0:
                log.command_rows.append((now_s, *command))
            if tick % 4 == 0:
                seen = pose + 5e-5 * random.standard_normal(3)
                log.odometry_rows.append((now_s, *map(float, seen), *map(float, speed)))
    return log


@settings(max_examples=15)
@given(st.floats(30, 150), st.floats(200, 1000), st.integers(0, 1000))
def test_any_scale_is_found_within_what_is_claimed(
    linear: float, angular: float, seed: int
) -> None:
    """The tool finds the scales of any board within five times the stated standard deviation.

    The scales come from the odometry and, for turns, also from the gyro.
    """
    found = speeds(drive((linear, linear, angular), seed), ASSUMED, UP, NO_BIAS)
    by = scale([one for one in found if one.axis < 2])
    assert abs(by.value - linear) < max(5 * by.sigma, 1e-4 * linear)
    assert by.sigma < 0.003 * linear
    turns = [one for one in found if one.axis == 2]
    for way in ("odometry", "gyro"):
        by = scale(turns, by=way)
        assert abs(by.value - angular) < max(5 * by.sigma, 1e-4 * angular)
        assert by.sigma < 0.003 * angular


@given(st.floats(10, 1000), st.floats(0.05, 0.5), st.integers(1, 5))
def test_what_is_commanded_is_a_whole_count_of_the_board(
    units: float, top: float, levels: int
) -> None:
    """Each planned command is a whole number of the board's counts, and not faster than ``top``.

    If one count is already faster than ``top``, the command is one count.
    """
    for _seconds, command in plan((top, top, top), (units, units, units), levels, 1.0):
        counts = [value * units for value in command]
        assert counts == pytest.approx([round(count) for count in counts], abs=1e-9)
        assert max(map(abs, command)) <= max(top, 1 / units) + 1e-9


def test_a_speed_that_the_driver_forgot_is_not_measured() -> None:
    """The tool discards the measurement of a speed if the logged commands for it have a gap.

    The driver's command timeout may have stopped the robot during the gap.
    """
    log = drive((70.0, 70.0, 500.0))
    held = len(speeds(log, ASSUMED, UP, NO_BIAS))
    middle = [number for number, row in enumerate(log.command_rows) if row[1] > 0.2][70]
    del log.command_rows[middle : middle + 20]
    assert len(speeds(log, ASSUMED, UP, NO_BIAS)) == held - 1


def test_a_gyro_that_contradicts_the_odometry_is_told() -> None:
    """If the gyro and the odometry differ by 5 %, a note recommends ``calibrate geometry``.

    A difference of 2 % is within the gyro's tolerance.
    """
    found = speeds(drive((70.0, 70.0, 500.0), gyro=1.05), ASSUMED, UP, NO_BIAS)
    assert any("calibrate geometry`, load" in note for note in result(found, NOW).notes)
    found = speeds(drive((70.0, 70.0, 500.0), gyro=1.02), ASSUMED, UP, NO_BIAS)
    assert len(result(found, NOW).notes) == 1


def test_axes_that_disagree_are_told() -> None:
    """The scales of x and y differ, but both axes share one parameter.

    A note gives the difference.
    """
    found = speeds(drive((70.0, 72.0, 500.0)), ASSUMED, UP, NO_BIAS)
    assert "x and y differ by 2.8%" in result(found, NOW).notes[0]


def test_what_cannot_be_measured_is_an_error() -> None:
    """The tool reports an error if no speed is steady or a measured speed has the wrong sign."""
    with pytest.raises(ToolError, match="no steady speed"):
        speeds(Log(), ASSUMED, UP, NO_BIAS)
    with pytest.raises(ToolError, match="axis_signs"):
        scale(speeds(drive((-70.0, -70.0, 500.0)), ASSUMED, UP, NO_BIAS)[:2])


def test_planted_scales_are_found_and_applied(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The board has other scales than usual. ``calibrate scale`` finds and ``--apply`` sets them.

    In this test, the driver accepts velocity commands only as TwistStamped.
    """
    monkeypatch.setattr(scale_module, "ACCELERATION", 2.0)
    monkeypatch.setattr(scale_module, "REST_S", 1.3)
    stamped = {"enable_stamped_cmd_vel": True}
    with rig(tmp_path, stamped, linear_scale=80.0, angular_scale=430.0) as robot:
        words = ("--levels", "1", "--seconds", "0.5", "--speed", "0.3", "--turning", "0.6")
        assert robot.calibrate("scale", *words, "--apply") == 0
        applied = parameters_of(robot.driver)
        written, table = robot.written(), capsys.readouterr().out
    for name, planted in (("linear_scale", 80.0), ("angular_scale", 430.0)):
        value, sigma = row(table, name)
        assert abs(value - planted) < max(4 * sigma, 0.002 * planted)
        assert sigma < 0.01 * planted  # on an idle machine, half of this
        assert written[name] == pytest.approx(value, rel=1e-3)
        assert applied[name] == written[name]
