# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that ``calibrate geometry`` and ``scale`` find the odometry scales of a two-wheeled base.

The user measures with a tape.
"""

import argparse
import math
from typing import Any

import numpy as np
import pytest

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.tools.calibrate import geometry, scale
from omnibot_driver.tools.calibrate.arguments import command_line
from omnibot_driver.tools.calibrate.console import Console
from omnibot_driver.tools.calibrate.log import Log
from omnibot_driver.tools.calibrate.motion import HALT, Bounds, Law
from omnibot_driver.tools.calibrate.odometry_scale import NAMES, plan
from omnibot_driver.tools.needs import ToolError

STEP_S = 0.02
TRUE_LINEAR, TRUE_ANGULAR = 1.04, 0.97


class TwoWheels:
    """A robot whose odometry reports distances that are too short and angles that are too large."""

    def __init__(self, **parameters: Any) -> None:
        self.parameters = {
            "max_linear_speed": 0.5,
            "max_angular_speed": 1.0,
            "odom_linear_scale": 1.0,
            "odom_angular_scale": 1.0,
        } | parameters
        self.true = Pose()

    def drive(self, law: Law, bounds: Bounds, *, show: Any) -> Log:
        log, told, seconds, command = Log(), Pose(), 0.0, HALT
        self.true = Pose()
        wanted = law(0.0, told)
        while wanted is not None or command != HALT:
            target = HALT if wanted is None else wanted
            assert target[1] == 0.0, "two wheels do not drive sideways"
            bounds.require_allowed("cmd_vel", target)
            command = bounds.approach("cmd_vel", command, target, STEP_S)
            self.true = self.true.moved(Pose(*command).times(STEP_S, STEP_S, STEP_S))
            told = self.told()
            seconds += STEP_S
            bounds.require_within(seconds, told)
            log.odometry_rows.append((seconds, told.x_m, told.y_m, told.yaw_rad, *command))
            show(seconds)
            wanted = law(seconds, told) if wanted is not None else None
        return log

    def told(self) -> Pose:
        linear = self.parameters["odom_linear_scale"] / TRUE_LINEAR
        angular = self.parameters["odom_angular_scale"] / TRUE_ANGULAR
        return self.true.times(linear, linear, angular)


def arguments(subcommand: str, *words: str) -> argparse.Namespace:
    return command_line().parse_args([subcommand, *words])


def answers(robot: TwoWheels, misread_mm: float = 0.0) -> Console:
    """Return a console whose user measures exactly. ``misread_mm`` is added to the last reading."""
    marks = [drive.wanted for drive in plan(1.0, 3)]
    asked = 0

    def read(question: str) -> str:
        nonlocal asked
        if "Mark the floor" in question or "room" in question:
            return "y"
        asked += 1
        if "degrees" in question:
            return str(math.degrees(robot.true.yaw_rad - marks[asked - 1]))
        return str(1000.0 * robot.true.way_m + (misread_mm if asked == len(marks) else 0.0))

    return Console(yes=False, read=read)


@pytest.mark.parametrize("subcommand", [geometry, scale])
@pytest.mark.parametrize("before", [1.0, 1.2])
def test_both_scales_are_found_by_tape(subcommand: Any, before: float) -> None:
    """``calibrate geometry`` and ``calibrate scale`` both find the true scales of the odometry.

    The value that ``odom_linear_scale`` had before does not matter.
    """
    robot = TwoWheels(odom_linear_scale=before)
    name = subcommand.__name__.rpartition(".")[2]
    found = subcommand.run(robot, answers(robot), arguments(name))
    assert list(found.parameters) == list(NAMES)
    assert np.allclose(list(found.parameters.values()), (TRUE_LINEAR, TRUE_ANGULAR), rtol=1e-3)
    assert not found.notes
    assert all(0.0 < finding.sigma < 0.01 for finding in found.findings)


class Encoder(TwoWheels):
    """A robot whose driver computes distances from encoder counts (``metres_per_count``).

    The driver takes the heading from a gyro.
    """

    def __init__(self, **parameters: Any) -> None:
        super().__init__(**parameters)
        for name in NAMES:
            del self.parameters[name]
        self.parameters |= {"metres_per_count": 0.0005, "linear_scale": 100.0}

    def told(self) -> Pose:
        linear = self.parameters["metres_per_count"] / 0.0004
        return self.true.times(linear, linear, 1.0)


def test_the_way_for_a_count_is_found_by_tape_and_the_units_with_it() -> None:
    """The tool finds ``metres_per_count`` and ``linear_scale`` from two straight drives.

    The user measures no turns: the robot's driver takes the heading from a gyro, and has no scale
    for turns.
    """
    robot = Encoder()
    console = Console(
        yes=False,
        read=lambda question: (
            "y"
            if "Mark the floor" in question or "room" in question
            else str(1000.0 * robot.true.way_m)
        ),
    )
    found = scale.run(robot, console, arguments("scale"))
    assert found.parameters == {
        "metres_per_count": pytest.approx(0.0004, rel=1e-3),
        "linear_scale": pytest.approx(125.0, rel=1e-3),
    }


@pytest.mark.parametrize(("shown", "found"), [("0.953", {"motor_balance": 0.953}), ("unknown", {})])
def test_the_balance_of_the_motors_that_the_driver_has_measured_is_written(
    shown: str, found: dict[str, float]
) -> None:
    """The tool saves ``motor_balance``, the ratio of the motors' speeds, if the driver measured it.

    The driver does not know this ratio until the robot has driven forward.
    """
    robot = Encoder(motor_balance=1.0)
    robot.diagnosed = {"Motor balance": shown}.__getitem__
    console = Console(
        yes=False,
        read=lambda question: "y" if "Mark" in question or "room" in question else "1000",
    )
    parameters = scale.run(robot, console, arguments("scale")).parameters
    assert {name: parameters[name] for name in parameters if "balance" in name} == found


def test_a_line_that_was_misread_is_told() -> None:
    """The user measures two straight drives of equal length, and misreads the tape once.

    A note gives the difference of the two results.
    """
    robot = TwoWheels()
    found = geometry.run(robot, answers(robot, misread_mm=100.0), arguments("geometry"))
    (note,) = found.notes
    assert "1 m forward and 1 m forward differ by" in note


def test_a_robot_that_may_not_move_is_not_driven() -> None:
    """The driver's ``max_angular_speed`` is 0.

    The tool ends with an error that names this parameter.
    """
    robot = TwoWheels(max_angular_speed=0.0)
    with pytest.raises(ToolError, match="max_angular_speed is 0"):
        geometry.run(robot, answers(robot), arguments("geometry"))
