# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""``calibrate scale``: find the board's command units from commanded and measured speeds."""

import argparse
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from omnibot_driver.tools.calibrate import odometry_scale
from omnibot_driver.tools.calibrate.console import Console
from omnibot_driver.tools.calibrate.motion import Bounds, stairs
from omnibot_driver.tools.calibrate.rest import rest, still
from omnibot_driver.tools.calibrate.result import Finding, Result
from omnibot_driver.tools.calibrate.speeds import SETTLE_S, Scale, Speed, plan, scale, speeds
from omnibot_driver.tools.needs import ToolError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REST_S: Final = 2.0
ACCELERATION: Final = 1.0
"""Acceleration of linear commands, in m/s². The acceleration of turns, in rad/s², is twice this
number."""
GYRO_TOLERANCE: Final = 0.03
"""Relative tolerance of the gyro's scale: MPU-6050 product specification, section 6.1."""
UNLIKE: Final = 4.0
"""The tool warns if two scales differ by more than this number of standard deviations."""


def run(robot: Any, console: Console, arguments: argparse.Namespace) -> Result:
    """Drive at several speeds and compute the scales. Raises ToolError if a drive fails."""
    now = robot.parameters
    if "angular_scale" not in now:
        return odometry_scale.run(robot, console, arguments)
    scales = (now["linear_scale"], now["linear_scale"], now["angular_scale"])
    linear = min(arguments.speed, now["max_linear_speed"])
    turning = min(arguments.turning, now["max_angular_speed"])
    step_s = arguments.seconds + SETTLE_S + 2 * linear / ACCELERATION
    steps = plan((linear, linear, turning), scales, arguments.levels, step_s)
    for _seconds, (x, y, yaw) in steps:
        if max(abs(x), abs(y)) > linear or abs(yaw) > turning:
            raise ToolError(
                "the slowest speed that a command can contain exceeds the limits: raise --speed or"
                " --turning, and if necessary max_linear_speed or max_angular_speed"
            )
    way_m = linear * step_s
    console.confirm(
        f"The robot will drive up to {way_m:.1f} m forward and back, then to the left and back."
        " Then it will turn on the spot in both directions. It will do this"
        f" {arguments.levels} times, at up to {linear:g} m/s and {turning:g} rad/s. Are"
        f" {2 * way_m:.1f} m clear all around?"
    )
    with console.progress("Listening at rest") as told:
        ask = still(np.array(now["gyro_bias"]))
        log = robot.rest(REST_S, show=lambda part: (ask(robot.log), told(part)))
    at_rest = rest(log.imu)
    total_s = step_s * len(steps)
    bounds = Bounds(
        speed=linear + 1e-6,
        turning=turning + 1e-6,
        way=2 * way_m + 0.1,
        turn=2 * turning * step_s + 0.5,
        seconds=total_s + 10.0,
        acceleration=ACCELERATION,
        angular_acceleration=2 * ACCELERATION,
    )
    with console.progress(f"Driving for {total_s:.0f} s") as told:
        log = robot.drive(stairs(steps), bounds, monitored=False, show=lambda s: told(s / total_s))
    return result(speeds(log, scales, at_rest.up, at_rest.bias_radps), now)


def result(found: Sequence[Speed], now: Mapping[str, Any]) -> Result:
    """Return the result, to show and to save.

    ``now``: the driver's parameters before the calibration.

    Raises ToolError if an axis lacks a measured speed.
    """
    by_axis = [[one for one in found if one.axis == axis] for axis in range(3)]
    if not all(by_axis):
        raise ToolError("not every axis was measured: increase --seconds")
    linear, angular = scale(by_axis[0] + by_axis[1]), scale(by_axis[2])
    x, y, gyro = scale(by_axis[0]), scale(by_axis[1]), scale(by_axis[2], by="gyro")
    units = ("LSB/(m/s)", "LSB/(rad/s)")
    ratio = angular.value / gyro.value
    ratio_sigma = ratio * math.hypot(angular.sigma / angular.value, gyro.sigma / gyro.value)
    rows = [
        ("linear_scale", linear, units[0], now["linear_scale"]),
        ("  by x alone", x, units[0], None),
        ("  by y alone", y, units[0], None),
        ("angular_scale", angular, units[1], now["angular_scale"]),
        ("  by the gyro", gyro, units[1], None),
        ("ratio of turns, gyro to odom", Scale(ratio, ratio_sigma, 1.0), "", None),
    ]
    notes = []
    if abs(x.value - y.value) > UNLIKE * math.hypot(x.sigma, y.sigma):
        notes.append(
            f"The scales of x and y differ by {abs(x.value / y.value - 1):.1%}: the wheels slip, or"
            " their radii differ."
        )
    if abs(ratio - 1) > GYRO_TOLERANCE + UNLIKE * ratio_sigma:
        notes.append(
            f"The turns by the gyro and by the odometry differ by {abs(ratio - 1):.1%}, more than"
            f" the gyro's tolerance of {GYRO_TOLERANCE:.0%}. Run `calibrate geometry`, load its"
            " values, then run `calibrate scale` again."
        )
    notes.append(
        "These values are based on the current `odom`. If `calibrate geometry` changes `odom`, run"
        " `calibrate scale` again afterwards."
    )
    return Result(
        findings=[
            Finding(name=name, value=one.value, sigma=one.sigma, unit=unit, before=before)
            for name, one, unit, before in rows
        ],
        parameters={"linear_scale": linear.value, "angular_scale": angular.value},
        notes=notes,
        draw=lambda figure: draw(figure, found, linear, angular, gyro),
    )


def draw(
    figure: "Figure", found: Sequence[Speed], linear: Scale, angular: Scale, gyro: Scale
) -> None:
    """Draw measured speeds, fitted lines and residuals. The commanded counts are the x axis."""
    axes = figure.subplots(2, 2, sharex="col", height_ratios=(2, 1))
    series = [
        (0, 0, linear, "odometry", "o", "tab:red", "x"),
        (1, 0, linear, "odometry", "s", "tab:green", "y"),
        (2, 1, angular, "odometry", "o", "tab:blue", "odom"),
        (2, 1, gyro, "gyro", "x", "tab:orange", "gyro"),
    ]
    for axis, column, line, by, marker, colour, label in series:
        mine = [one for one in found if one.axis == axis]
        counts = np.array([one.counts for one in mine], dtype=float)
        speed = np.array([one.measured if by == "odometry" else one.gyro for one in mine])
        sigma = np.array([one.sigma if by == "odometry" else one.gyro_sigma for one in mine])
        upper, lower = axes[0, column], axes[1, column]
        upper.plot(counts, speed, marker, color=colour, label=label)
        upper.plot(counts, counts / line.value, color=colour, lw=0.8)
        lower.errorbar(
            counts, 1000 * (speed - counts / line.value), 1000 * sigma, fmt=marker, color=colour
        )
    for column, (name, one, unit) in enumerate(
        (("linear_scale", linear, "m/s"), ("angular_scale", angular, "rad/s"))
    ):
        axes[0, column].set(title=f"{name}: {one.value:.2f} ± {one.sigma:.2f}", ylabel=unit)
        axes[0, column].legend()
        axes[1, column].set(xlabel="commanded, LSB", ylabel=f"residual, m{unit}")
        axes[1, column].axhline(0.0, color="grey", lw=0.8)
