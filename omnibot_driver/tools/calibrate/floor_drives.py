# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Drives on the ground, each of which the user measures with a tape.

This module knows drives and questions; it does not know what is computed from them.
"""

import argparse
import math
from collections.abc import Callable, Sequence
from typing import Any, Protocol, TypeVar

import numpy as np

from omnibot_driver.tools.calibrate.console import Console
from omnibot_driver.tools.calibrate.log import Column
from omnibot_driver.tools.calibrate.motion import Bounds, Law
from omnibot_driver.tools.needs import ToolError


class Planned(Protocol):
    """A planned drive. Its ``name`` describes the drive to the user."""

    @property
    def name(self) -> str: ...


Drive = TypeVar("Drive", bound=Planned)
Measured = TypeVar("Measured")


def measured(
    console: Console,
    drives: Sequence[Drive],
    arguments: argparse.Namespace,
    go: Callable[[Drive], Column],
    measure: Callable[[Drive, Column], Measured],
) -> list[Measured]:
    """Run each drive and let the user measure it; return the measurements.

    * ``go``: makes a drive, and returns its odometry poses.
    * ``measure``: asks the user for the end of the drive.

    Raises ToolError if a drive fails, or if there is not enough space.
    """
    console.confirm(
        f"The robot will make {len(drives)} drives at up to {arguments.speed:g} m/s. Each drive"
        f" stays within {arguments.side:g} m of its start, forward and to both sides. Is there"
        " enough room?"
    )
    found = []
    for number, drive in enumerate(drives, 1):
        console.wait(f"Drive {number} of {len(drives)}: {drive.name}. Mark the floor.")
        found.append(measure(drive, go(drive)))
    return found


def speeds(robot: Any, arguments: argparse.Namespace) -> tuple[float, float]:
    """Return the user's choice of speed (m/s) and yaw rate (rad/s), within the driver's limits.

    Raises ToolError if the speed or the rate is 0.
    """
    now = robot.parameters
    speed = min(arguments.speed, now["max_linear_speed"])
    turning = min(arguments.turning, now["max_angular_speed"])
    if not (speed and turning):
        raise ToolError(
            "max_linear_speed or max_angular_speed is 0, so the robot must not move;"
            " set both above 0"
        )
    return speed, turning


def driven(
    robot: Any,
    console: Console,
    name: str,
    law: Law,
    arguments: argparse.Namespace,
    *,
    turn_rad: float,
    seconds: float,
) -> Column:
    """Drive the robot by a control law; return the odometry's poses, (n, 3), in m, m and rad.

    ``turn_rad``, ``seconds``: expected turn and duration. Raises ToolError if the drive fails.
    """
    speed, turning = speeds(robot, arguments)
    bounds = Bounds(
        speed=speed + 1e-6,
        turning=turning + 1e-6,
        way=1.5 * arguments.side + 0.2,
        turn=turn_rad + 1.0,
        seconds=3 * seconds,
    )
    with console.progress(f"Driving {name}") as told:
        log = robot.drive(law, bounds, show=lambda s: told(s / seconds))
    path: Column = log.odometry.pose
    if not len(path) or not np.isfinite(path).all():
        raise ToolError("odom has no poses, or contains NaN or infinity: see the driver's log")
    return path


def turned_past_mark(console: Console) -> float:
    """Ask for the angle from the floor mark to the robot's front, and return it in rad.

    The angle is positive if the front points left of the mark.
    """
    return math.radians(
        console.number(
            "Angle from the floor mark to the robot's front (+ if the front points left of the"
            " mark, - if right)",
            "degrees",
            -170.0,
            170.0,
        )
    )
