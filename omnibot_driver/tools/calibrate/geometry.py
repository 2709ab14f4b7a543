# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""``calibrate geometry``: find wheel and base radius from drives measured with a tape."""

import argparse
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from omnibot_driver import boards
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.tools.calibrate import floor_drives, odometry_scale
from omnibot_driver.tools.calibrate.console import Console
from omnibot_driver.tools.calibrate.geometry_figure import draw
from omnibot_driver.tools.calibrate.geometry_fit import Geometry, Reading, fit, rolled
from omnibot_driver.tools.calibrate.log import Column
from omnibot_driver.tools.calibrate.result import Finding, Result
from omnibot_driver.tools.calibrate.seen import WHEELS
from omnibot_driver.tools.calibrate.waypoints import square, visit

PLAIN: Final = 0.005
"""Limit for the deviation of a wheel's radius from the mean radius, as a fraction of the mean. The
tool warns of a larger deviation if it also exceeds three of its standard deviations."""
INTRODUCTION: Final = (
    "You need a tape measure and something to mark the floor with. Before each drive, mark the"
    " floor under the robot's centre (use a plumb line, or a fixed point of the lowest deck), and"
    " mark where the front points. After the drive, enter where the robot stands relative to"
    " these marks: forward and left are positive, back and right are negative. Do not push the"
    " robot or correct its course."
)


@dataclass(frozen=True, slots=True)
class Drive:
    """A drive through the poses ``places``.

    ``heading``: whether the user measures the heading at the end of the drive, not the position.
    """

    name: str
    places: list[Pose]
    heading: bool


def run(robot: Any, console: Console, arguments: argparse.Namespace) -> Result:
    """Run the drives and compute the geometry. Raises ToolError if a drive or the fit fails."""
    if "base_radius" not in robot.parameters:
        return odometry_scale.run(robot, console, arguments)
    console.say(INTRODUCTION)
    drives = plan(arguments.side, arguments.turns, squares=not arguments.without_squares)
    readings = floor_drives.measured(
        console,
        drives,
        arguments,
        lambda drive: _drive(robot, console, drive, arguments),
        lambda drive, path: _reading(console, drive, path, arguments),
    )
    now = robot.parameters
    found = fit(readings, believed(now)["base_radius"], now["odom_wheel_drift"])
    return result(readings, found, now)


def believed(now: Mapping[str, Any]) -> dict[str, float]:
    """Return the sizes in m and the scales from which ``odom`` is computed, by parameter name."""
    if now["delta_frame"] == "wheel_counts":
        return {name: now[name] for name in ("wheel_radius", "base_radius")}
    # The board computes the odometry from the manual's sizes, and the driver scales the result.
    linear, angular = now["odom_linear_scale"], now["odom_angular_scale"]
    nominal = boards.load(now["board"]).PARAMETERS.by_name
    wheel_m, base_m = (nominal[name].default for name in ("wheel_radius", "base_radius"))
    return {
        "wheel_radius": wheel_m * linear,
        "base_radius": base_m * linear / angular,
        "odom_linear_scale": linear,
        "odom_angular_scale": angular,
    }


def plan(side_m: float, turns: int, *, squares: bool) -> list[Drive]:
    """Return the planned drives, in order."""
    angle_rad = math.tau * turns
    number = f"{turns} turns" if turns > 1 else "1 turn"
    drives = [
        Drive(f"{number} to the left", [Pose(0.0, 0.0, angle_rad)], True),
        Drive(f"{number} to the right", [Pose(0.0, 0.0, -angle_rad)], True),
        Drive(f"{side_m:g} m forward", [Pose(side_m, 0.0, 0.0)], False),
        Drive(f"{side_m:g} m to the left", [Pose(0.0, side_m, 0.0)], False),
    ]
    if squares:
        drives += [
            Drive("a square to the left", square(side_m, 1), False),
            Drive("a square to the right", square(side_m, -1), False),
        ]
    return drives


def _drive(robot: Any, console: Console, drive: Drive, arguments: argparse.Namespace) -> Column:
    speed, turning = floor_drives.speeds(robot, arguments)
    way_m = turn_rad = 0.0
    for before, after in zip([Pose(), *drive.places], drive.places, strict=False):
        way_m += (after - before).way_m
        turn_rad += abs((after - before).yaw_rad)
    return floor_drives.driven(
        robot,
        console,
        drive.name,
        visit(drive.places, speed, turning),
        arguments,
        turn_rad=abs(drive.places[-1].yaw_rad),
        seconds=way_m / speed + turn_rad / turning + 2.0 * len(drive.places),
    )


def _reading(
    console: Console, drive: Drive, path: Column, arguments: argparse.Namespace
) -> Reading:
    end = np.full(3, math.nan)
    if drive.heading:
        end[2] = drive.places[-1].yaw_rad + floor_drives.turned_past_mark(console)
    else:
        far_mm = 3000.0 * arguments.side
        for axis, question in enumerate(("forward of", "to the left of")):
            asked = f"How far is the robot's centre {question} its mark"
            end[axis] = console.number(asked, "mm", -far_mm, far_mm) / 1000.0
    sigma = np.array([arguments.tape / 1000.0] * 2 + [math.radians(arguments.angle)])
    return Reading(drive.name, path, end, sigma)


def result(readings: Sequence[Reading], found: Geometry, now: Mapping[str, Any]) -> Result:
    """Return the result to show and to save.

    ``found``: the geometry that was fitted to the readings.

    ``now``: the driver's parameters before the calibration.
    """
    wheels_sigma, base_sigma = map(float, np.sqrt(np.diag(found.covariance)[:2]))
    factors = {
        "wheel_radius": (found.wheels, wheels_sigma, "m"),
        "base_radius": (found.base, base_sigma, "m"),
        "odom_linear_scale": (found.wheels, wheels_sigma, "m/m"),
        "odom_angular_scale": (found.turn, found.turn_sigma, "rad/rad"),
    }
    was = believed(now)
    findings = [
        Finding(name=name, value=size * factors[name][0], sigma=size * factors[name][1],
                unit=factors[name][2], before=now[name])
        for name, size in was.items()
    ]  # fmt: skip
    parameters = {name: size * factors[name][0] for name, size in was.items()}
    findings += [
        Finding(name=f"wheel {wheel}, size above the mean", value=100 * float(more),
                sigma=100 * float(sigma), unit="%")
        for wheel, more, sigma in zip(WHEELS, found.unlike, found.unlike_sigma, strict=True)
    ]  # fmt: skip
    before, after = misses(readings, found, was["base_radius"])
    notes = [
        f"The mean error of the odometry was {before * 1000:.0f} mm; with these values it would"
        f" have been {after * 1000:.0f} mm.",
        "These values correct the odometry, but not the speeds of the robot. Load the values, then"
        " run `calibrate scale` for the speeds.",
    ]
    notes += [
        f"Wheel {wheel} is {abs(more):.1%} {'larger' if more > 0 else 'smaller'} than the mean."
        f" No parameter corrects this. Check the rollers of wheel {wheel}, and whether all wheels"
        " carry the same load."
        for wheel, more, sigma in zip(WHEELS, found.unlike, found.unlike_sigma, strict=True)
        if abs(more) > max(PLAIN, 3 * sigma)
    ]
    if found.excess > 2.0:
        notes.append(
            f"The readings scatter {found.excess:.1f} times as much as --tape, --angle and"
            " odom_wheel_drift predict. The uncertainties above already include this factor."
            " Perhaps a reading is wrong, or the wheels slip."
        )
    return Result(
        findings=findings,
        parameters=parameters,
        notes=notes,
        draw=lambda figure: draw(figure, readings, found, was["base_radius"]),
    )


def misses(
    readings: Sequence[Reading], found: Geometry, base_radius_m: float
) -> tuple[float, float]:
    """Return two mean errors of the odometry at the ends of the drives, in m.

    The first error is for the driver's current geometry, the second for the base radius and the
    mean wheel radius of ``found``.
    """
    before: list[float] = []
    after: list[float] = []
    for one in readings:
        if not np.isnan(one.end[:2]).any():
            for sizes, into in (((1.0, 1.0), before), ((found.wheels, found.base), after)):
                end = rolled(one.path, np.full(3, sizes[0]), sizes[1], base_radius_m)[-1]
                into.append(float(np.hypot(*(end - one.end)[:2])))
    return sum(before) / len(before), sum(after) / len(after)
