# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""``calibrate imu``: find biases, noise and level of the IMU while the robot rests."""

import argparse
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from omnibot_driver.core.reporting.status import RUNNING
from omnibot_driver.tools.calibrate.console import Console
from omnibot_driver.tools.calibrate.log import Imu
from omnibot_driver.tools.calibrate.rest import Rest, rest, still
from omnibot_driver.tools.calibrate.result import Finding, Result
from omnibot_driver.tools.needs import ToolError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AXES: Final = "xyz"
COLOURS: Final = ("tab:red", "tab:green", "tab:blue")
DRAWN: Final = 1000
"""Largest number of readings in a plot. More would enlarge the file without a visible effect."""
GRAVITY_SIGMA: Final = 0.01
"""Standard deviation of the user's value for the local gravity, in m/s²."""


def run(robot: Any, console: Console, arguments: argparse.Namespace) -> Result:
    """Record the IMU while the robot is at rest, and evaluate the readings.

    Raises ToolError if the robot moves, or if the readings cannot be used.
    """
    if robot.parameters["auto_gyro_bias"]:
        raise ToolError(
            "auto_gyro_bias is on, so the driver would change the bias during the measurement;"
            " set auto_gyro_bias to false"
        )
    console.confirm(
        f"The measurement takes {60 * arguments.minutes:g} s. Does the robot stand still on a"
        " level floor, and will it stay untouched?"
    )
    biases = {name: np.array(robot.parameters[name]) for name in ("gyro_bias", "accel_bias")}
    ask = still(biases["gyro_bias"])
    with console.progress("Listening to the IMU") as told:

        def show(part: float) -> None:
            ask(robot.log)
            told(part)

        log = robot.rest(60 * arguments.minutes, show=show, states=RUNNING)
    imu = log.imu
    as_sensed = Imu(
        imu.stamp_s, imu.force_mps2 + biases["accel_bias"], imu.rate_radps + biases["gyro_bias"]
    )
    return result(rest(as_sensed), as_sensed, robot.parameters, arguments.gravity)


def result(found: Rest, imu: Imu, now: dict[str, Any], gravity_mps2: float) -> Result:
    """Return the result to show and to save.

    ``imu``: the readings from which the driver has not subtracted the biases.

    ``now``: the driver's parameters before the calibration.
    """
    too_long_mps2 = found.gravity_mps2 - gravity_mps2
    accel_bias = too_long_mps2 * found.up
    along_sigma = math.hypot(GRAVITY_SIGMA, float(found.force_sigma.max()))
    findings = [
        Finding(
            name=f"gyro_bias {axis}",
            value=float(found.bias_radps[n]),
            sigma=float(found.bias_sigma[n]),
            unit="rad/s",
            before=now["gyro_bias"][n],
        )
        for n, axis in enumerate(AXES)
    ]
    stddevs = {
        "angular_velocity_stddev": (found.rate_noise, "rad/s"),
        "linear_acceleration_stddev": (found.force_noise, "m/s²"),
    }
    worst = {name: float(noise.max()) for name, (noise, _unit) in stddevs.items()}
    findings += [
        Finding(
            name=name,
            value=worst[name],
            sigma=worst[name] / math.sqrt(2 * found.readings),
            unit=unit,
            before=now[name],
        )
        for name, (_noise, unit) in stddevs.items()
    ]
    roll_rad, pitch_rad = found.level_rad
    sigma_deg = math.degrees(found.level_sigma_rad)
    findings += [
        Finding(name="accel_bias along gravity", value=too_long_mps2, sigma=along_sigma,
                unit="m/s²", before=float(found.up @ now["accel_bias"])),
        Finding(name="gravity as measured", value=found.gravity_mps2,
                sigma=float(found.force_sigma.max()), unit="m/s²"),
        Finding(name="IMU roll", value=math.degrees(roll_rad) % 360, sigma=sigma_deg, unit="°"),
        Finding(name="IMU pitch", value=math.degrees(pitch_rad), sigma=sigma_deg, unit="°"),
    ]  # fmt: skip
    for axis, noise in zip(AXES, found.noises, strict=True):
        findings.append(
            Finding(name=f"gyro noise density {axis}", value=math.degrees(noise.density),
                    sigma=math.degrees(noise.sigma), unit="°/s/√Hz")
        )  # fmt: skip
    for axis, noise in zip(AXES, found.noises, strict=True):
        if noise.instability:
            value = 3600 * math.degrees(noise.instability)
            findings.append(
                Finding(name=f"gyro bias instability {axis}", value=f"{value:.2g}", unit="°/h")
            )
        if noise.walk:
            value = math.degrees(noise.walk)
            findings.append(
                Finding(name=f"gyro bias walk {axis}", value=f"{value:.2g}", unit="°/s/√s")
            )
    return Result(
        findings=findings,
        parameters={
            "gyro_bias": [float(value) for value in found.bias_radps],
            "accel_bias": [float(value) for value in accel_bias],
            **worst,
        },
        notes=[
            f"{found.readings} readings in {found.readings * found.period_s:.0f} s. At rest only"
            " one part of the accelerometer's bias can be measured: the part along gravity. Roll"
            " and pitch include the slope of the floor. For the robot's description, use"
            f" imu_rpy:='{roll_rad % math.tau:.4f} {pitch_rad:.4f} <yaw>'."
        ],
        draw=lambda figure: draw(figure, found, imu),
    )


def draw(figure: "Figure", found: Rest, imu: Imu) -> None:
    """Draw rates and forces over time, and the Allan deviation with the fitted noise terms."""
    grid = figure.add_gridspec(2, 2)
    rates, forces = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[1, 0])
    seconds = imu.stamp_s - imu.stamp_s[0]
    step = math.ceil(len(seconds) / DRAWN)
    for n, (axis, colour) in enumerate(zip(AXES, COLOURS, strict=True)):
        rates.plot(seconds[::step], np.degrees(imu.rate_radps[::step, n]), ".", ms=1, color=colour)
        rates.axhline(math.degrees(found.bias_radps[n]), color=colour, label=axis)
        off = imu.force_mps2[::step, n] - found.force_mps2[n]
        forces.plot(seconds[::step], off, ".", ms=1, color=colour)
    rates.set(title="Gyro at rest, and its bias", ylabel="°/s")
    rates.legend(loc="upper right")
    forces.set(title="Accelerometer minus its mean", ylabel="m/s²", xlabel="s")
    right = figure.add_subplot(grid[:, 1])
    for axis, colour, curve, noise in zip(AXES, COLOURS, found.curves, found.noises, strict=True):
        right.errorbar(
            curve.tau_s,
            np.degrees(curve.deviation),
            np.degrees(curve.sigma),
            fmt=".",
            color=colour,
            label=f"{axis}: {math.degrees(noise.density):.4f} °/s/√Hz",
        )
        right.plot(curve.tau_s, np.degrees(noise.deviation(curve.tau_s)), color=colour)
    right.set(title="Allan deviation of the gyro", xlabel="averaging time, s", ylabel="°/s")
    right.set(xscale="log", yscale="log")
    right.grid(which="both", alpha=0.3)
    right.legend()
