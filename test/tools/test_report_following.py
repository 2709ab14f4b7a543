# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of a report's verdict on how a robot with slow motors follows its commands."""

from dataclasses import replace

import numpy as np
import pytest
from drives import Array, Drive

from omnibot_driver.tools.report.findings import Finding, Level
from omnibot_driver.tools.report.judge import judge

STEP_S = 0.01
TIMES_S = np.arange(0.0, 40.0, STEP_S)
MOVING = (TIMES_S >= 4.0) & (TIMES_S < 36.0)
TWO_WHEELS = ("left_wheel_joint", "right_wheel_joint")


def stretches(seconds: float) -> Array:
    """Return commands that drive straight and turn in alternation, ``seconds`` each."""
    straight = (TIMES_S - 4.0) % (2 * seconds) < seconds
    rows = np.column_stack([0.2 * straight, 0.0 * straight, 0.4 * ~straight])
    return np.asarray(rows * MOVING[:, None])


def wave(period_s: float) -> Array:
    """Return commands that always change, as those of a joystick do."""
    phase = 2 * np.pi * TIMES_S / period_s
    rows = np.column_stack([0.2 * np.sin(phase), 0.0 * phase, 0.4 * np.cos(phase)])
    return np.asarray(rows * MOVING[:, None])


def behind(commands: Array, slow_s: float) -> Array:
    """Return the motion of motors that react with the time constant ``slow_s``."""
    motion = np.zeros_like(commands)
    for row in range(1, len(commands)):
        motion[row] = motion[row - 1] + STEP_S / slow_s * (commands[row] - motion[row - 1])
    return motion


def verdict(commands: Array, motion: Array, wheels: tuple[str, ...] = TWO_WHEELS) -> Finding:
    """Return the finding that tells how the ``motion`` follows the ``commands``."""
    drive = Drive(seconds=40.0)
    drive.cmd_vel.values = commands[::10]
    drive.odom.values[:, 3:] = motion[::4]
    drive.joints.values = drive.joints.values[:, : len(wheels)]
    log = replace(drive.log(), wheels=wheels)
    (found,) = [one for one in judge(log) if one.text.startswith("The robot follows cmd_vel")]
    return found


@pytest.mark.parametrize("slow_s", [0.2, 0.3])
def test_slow_motors_that_reach_the_commanded_speed_are_good(slow_s: float) -> None:
    """A robot drives straight and turns, 3 s each. Its motors are slow, but its scales are right.

    The report compares only speeds that are steady, so the verdict is good.
    """
    commands = stretches(3.0)
    found = verdict(commands, behind(commands, slow_s))
    assert found.level is Level.GOOD, found.text
    assert "vx 1.00" in found.text
    assert "yaw rate 1.00" in found.text


def test_slow_motors_do_not_hide_a_wrong_scale() -> None:
    """A robot with slow motors finally reaches only 80 % of the commanded yaw rate.

    The report warns and gives this ratio. For two wheels, it advises a check with a tape measure,
    not a new scale.
    """
    commands = stretches(3.0)
    found = verdict(commands, behind(commands, 0.3) * [1.0, 1.0, 0.8])
    assert found.level is Level.WARN
    assert "vx 1.00" in found.text
    assert "yaw rate 0.80" in found.text
    assert "tape measure" in found.advice
    assert "odom_" not in found.advice


@pytest.mark.parametrize("wheels", [TWO_WHEELS, ("wheel_a", "wheel_b", "wheel_c")], ids=len)
def test_commands_that_always_change_give_no_advice_on_scales(wheels: tuple[str, ...]) -> None:
    """If the commands always change, the only advice is to record constant commands.

    The report gives the ratios of measured to commanded speed only in a note.
    """
    commands = wave(3.0)
    found = verdict(commands, behind(commands, 0.5), wheels)
    assert found.level is Level.NOTE, found.text
    assert "not constant for long enough to judge vx, yaw rate" in found.text
    assert "scale" not in found.advice
    assert "constant commands" in found.advice


def test_a_speed_that_still_swings_gives_no_advice_on_scales() -> None:
    """The robot's speed swings all the time, and its mean is 15 % above the commanded speed.

    So the report gives the ratio of measured to commanded speed only in a note.
    """
    commands = stretches(3.0)
    swing = 1.15 + 0.2 * np.sin(2 * np.pi * TIMES_S / 1.5)
    found = verdict(commands, commands * swing[:, None])
    assert found.level is Level.NOTE, found.text


def test_the_wrong_direction_is_told_also_if_the_commands_always_change() -> None:
    """The commands always change, and the robot turns in the wrong direction.

    The report says so, because slow motors cannot cause this.
    """
    commands = wave(3.0)
    found = verdict(commands, behind(commands, 0.1) * [1.0, 1.0, -1.0])
    assert found.level is Level.WARN
    assert "moves the wrong way" in found.advice
