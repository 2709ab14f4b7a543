# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""``calibrate geometry`` and ``calibrate scale`` for a base that only drives straight and turns.

If the driver has the parameter ``metres_per_count``, the tool finds ``metres_per_count``,
``linear_scale`` and ``motor_balance``. Otherwise, it finds the scales of the odometry. This module
does not know the base's wheels.
"""

import argparse
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.tools.calibrate import floor_drives
from omnibot_driver.tools.calibrate.console import Console
from omnibot_driver.tools.calibrate.log import Column
from omnibot_driver.tools.calibrate.motion import Law
from omnibot_driver.tools.calibrate.result import Finding, Result
from omnibot_driver.tools.calibrate.waypoints import straight, turn

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LINES: Final = 2
"""Number of straight drives. A wrong measurement by the user shows as a difference of the
results."""
UNLIKE: Final = 4.0
"""Limit for the difference between the results of two drives of the same kind, in standard
deviations of the difference. The tool warns if the difference is larger."""
NAMES: Final = ("odom_linear_scale", "odom_angular_scale")
COUNT, UNITS = "metres_per_count", "linear_scale"
"""Names of two parameters: m per encoder count, and number of motor units per m/s. The tool
multiplies ``COUNT`` by a factor, and divides ``UNITS`` by the same factor."""
BALANCE, BALANCE_SHOWN, BALANCE_SIGMA = "motor_balance", "Motor balance", 0.01
"""The balance of the two motors, which the driver measures: name of the parameter, name in
/diagnostics, and standard deviation of the measured value."""
INTRODUCTION: Final = (
    "You need a tape measure and something to mark the floor with. Before each drive, mark where"
    " the robot's centre is and where the front points. After a straight drive, enter how far the"
    " robot has driven. After a turn, enter the angle from the mark to the front. Do not push the"
    " robot or correct its course."
)


@dataclass(frozen=True, slots=True)
class Drive:
    """A drive straight ahead, or a turn on the spot.

    ``wanted``: distance in m, or angle in rad.
    """

    name: str
    wanted: float
    turns: bool


@dataclass(frozen=True, slots=True)
class Ratio:
    """The motion in one drive, in m or rad, measured by the user and by the odometry.

    * ``told``: motion that the odometry measured.
    * ``true``, ``sigma``: motion that the user measured, and its standard deviation.
    """

    drive: Drive
    told: float
    true: float
    sigma: float

    @property
    def value(self) -> float:
        """Motion that the user measured, divided by the motion that the odometry measured."""
        return self.true / self.told

    @property
    def value_sigma(self) -> float:
        """Standard deviation of ``value``, the ratio of the two measurements."""
        return self.sigma / abs(self.told)


def run(robot: Any, console: Console, arguments: argparse.Namespace) -> Result:
    """Run the drives and compute the scales. Raises ToolError if a drive fails."""
    console.say(INTRODUCTION)
    drives = plan(arguments.side, arguments.turns)
    if COUNT in robot.parameters:
        drives = [drive for drive in drives if not drive.turns]
    ratios = floor_drives.measured(
        console,
        drives,
        arguments,
        lambda drive: _drive(robot, console, drive, arguments),
        lambda drive, path: _measure(console, drive, path, arguments),
    )
    shown = robot.diagnosed(BALANCE_SHOWN) if BALANCE in robot.parameters else ""
    return result(ratios, robot.parameters, balance=_number(shown))


def plan(side_m: float, turns: int) -> list[Drive]:
    """Return the planned drives, in order."""
    number, angle_rad = f"{turns} turns" if turns > 1 else "1 turn", math.tau * turns
    return [
        Drive(f"{number} to the left", angle_rad, True),
        Drive(f"{number} to the right", -angle_rad, True),
        *[Drive(f"{side_m:g} m forward", side_m, False)] * LINES,
    ]


def _drive(robot: Any, console: Console, drive: Drive, arguments: argparse.Namespace) -> Column:
    speed, turning = floor_drives.speeds(robot, arguments)
    law: Law = turn(drive.wanted, turning) if drive.turns else straight(drive.wanted, speed)
    return floor_drives.driven(
        robot,
        console,
        drive.name,
        law,
        arguments,
        turn_rad=abs(drive.wanted) if drive.turns else 0.0,
        seconds=abs(drive.wanted) / (turning if drive.turns else speed) + 5.0,
    )


def _measure(console: Console, drive: Drive, path: Column, arguments: argparse.Namespace) -> Ratio:
    first, last = Pose(*path[0]), Pose(*path[-1])
    if drive.turns:
        true = drive.wanted + floor_drives.turned_past_mark(console)
        sigma = math.radians(arguments.angle)
        return Ratio(drive, last.yaw_rad - first.yaw_rad, true, sigma)
    come_mm = console.number(
        "How far did the robot's centre move", "mm", 1.0, 3000.0 * arguments.side
    )
    return Ratio(drive, first.way_to(last).way_m, come_mm / 1000.0, arguments.tape / 1000.0)


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def result(
    ratios: Sequence[Ratio], now: Mapping[str, Any], *, balance: float | None = None
) -> Result:
    """Return the result, to show and to save.

    ``now``: the driver's parameters before the calibration.

    ``balance``: the value for ``motor_balance`` that the driver measured, or None.
    """
    findings, parameters, notes = [], {}, []
    names = ((COUNT, False),) if COUNT in now else tuple(zip(NAMES, (False, True), strict=True))
    for name, turns in names:
        mine = [one for one in ratios if one.drive.turns is turns]
        weights = np.array([one.value_sigma**-2 for one in mine])
        mean = float(weights @ [one.value for one in mine] / weights.sum())
        sigma = float(weights.sum() ** -0.5)
        unit = "m" if name == COUNT else "rad/rad" if turns else "m/m"
        found = {name: (now[name] * mean, now[name] * sigma, unit)}
        if name == COUNT:
            before = now[UNITS]
            found[UNITS] = before / mean, before * sigma / mean**2, "unit/(m/s)"
        if name == COUNT and balance is not None:
            found[BALANCE] = balance, BALANCE_SIGMA, ""
        for each, (value, value_sigma, of) in found.items():
            parameters[each] = value
            findings.append(
                Finding(name=each, value=value, sigma=value_sigma, unit=of, before=now[each])
            )
        one, other = mine
        if abs(one.value - other.value) > UNLIKE * math.hypot(one.value_sigma, other.value_sigma):
            notes.append(
                f"The results of {one.drive.name} and {other.drive.name} differ by"
                f" {abs(one.value / other.value - 1):.1%}: one of your measurements is wrong,"
                " or the robot slips."
            )
    return Result(
        findings=findings,
        parameters=parameters,
        notes=notes,
        draw=lambda figure: draw(figure, ratios),
    )


def draw(figure: "Figure", ratios: Sequence[Ratio]) -> None:
    """Plot for each drive the user's measurement, divided by the odometry's measurement."""
    axes = figure.subplots()
    names = [f"{number}. {one.drive.name}" for number, one in enumerate(ratios, 1)]
    values = [one.value for one in ratios]
    axes.errorbar(names, values, [one.value_sigma for one in ratios], fmt="o", color="tab:blue")
    axes.axhline(1.0, color="grey", lw=0.8)
    axes.set(ylabel="motion by the tape / motion by odom", title="Factor that corrects odom")
