# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The result of ``calibrate commission``, for the table, the file and the user."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from matplotlib.patches import Circle

from omnibot_driver.parameters import Value
from omnibot_driver.tools.calibrate.mounting import Mounting
from omnibot_driver.tools.calibrate.result import Finding, Result
from omnibot_driver.tools.calibrate.seen import WHEELS, Pattern, mirrored

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WHEEL_BEARINGS_RAD: Final = (-math.pi / 3, math.pi / 3, math.pi)
"""Directions from the robot's centre to wheels A, B, C, in rad, counter-clockwise from the front.

Source: manual, "Control equation".
"""
SEEN_FROM_ABOVE: Final = 0.3
COLOURS: Final = {"x": "C3", "y": "C2", "z": "C0"}


@dataclass(slots=True)
class Found:
    """The results of a commissioning. A result that was not determined is None.

    ``before``: the driver's parameters before the commissioning.
    """

    before: dict[str, Any]
    control_method: str | None = None
    delta_frame: str | None = None
    wheel_signs: Pattern | None = None
    axis_signs: Pattern | None = None
    mounting: Mounting | None = None


def result_of(found: Found) -> Result:
    """Return the result: values of the driver's parameters, and the mounting of the IMU."""
    parameters: dict[str, Value] = {}
    for name in ("control_method", "delta_frame", "axis_signs"):
        value = getattr(found, name)
        if value is not None:
            parameters[name] = list(value) if isinstance(value, tuple) else value
    findings = [
        Finding(name=name, value=str(value), before=str(found.before[name]))
        for name, value in parameters.items()
    ]
    notes = _remarks(found)
    record: dict[str, Any] = {}
    if found.mounting is not None:
        chosen = found.mounting.snapped() or found.mounting
        angles = [round(angle, 4) + 0.0 for angle in chosen.rpy_rad]  # no -0.0
        record["imu_rpy"] = angles
        findings += _angles(found.mounting, chosen)
        words = " ".join(f"{angle:.4f}" for angle in angles)
        notes.append(
            "The driver does not rotate the IMU's axes; the robot's description contains the"
            f" rotation. Start description.launch.py with\n  xacro_args:=\"imu_rpy:='{words}'\""
        )
    return Result(
        findings=findings,
        parameters=parameters,
        record=record,
        notes=notes,
        draw=lambda figure: draw(figure, found),
    )


def _angles(measured: Mounting, chosen: Mounting) -> list[Finding]:
    sigma_deg = math.degrees(measured.yaw_sigma_rad)
    names = ("IMU roll", "IMU pitch", "IMU yaw")
    sigmas = (None, None, sigma_deg)
    rows = zip(names, measured.rpy_rad, chosen.rpy_rad, sigmas, strict=True)
    return [
        Finding(
            name=f"{name} (taken as {round(math.degrees(taken))}°)",
            value=round(math.degrees(angle), 1) + 0.0,
            sigma=sigma,
            unit="°",
        )
        for name, angle, taken, sigma in rows
    ]


def _remarks(found: Found) -> list[str]:
    remarks = []
    if found.control_method == "position":
        remarks.append(
            "With the switch on positional control, the driver accepts only cmd_pose. To command"
            " velocities, move the switch, reboot the board and calibrate again."
        )
    if found.wheel_signs == (-1, -1, -1):
        remarks.append(
            "All wheels turn in the opposite direction to that in the manual. axis_signs corrects"
            " cmd_vel and odom, but wheel_cmd and joint_states stay reversed."
        )
    if found.axis_signs is not None and mirrored(found.axis_signs):
        remarks.append(
            "The signs of the axes describe a mirror image of the robot. A wrong choice of the"
            " robot's front cannot cause this, so check your answers. If your answers are right,"
            " control the robot by velocities: with these signs, the driver does not start if"
            " control_method is 'position'."
        )
    if found.delta_frame not in (None, found.before["delta_frame"]):
        remarks.append(
            "delta_frame is read at the start of the driver. Restart the driver with this file,"
            " then run `calibrate commission --only board` to check the new value."
        )
    return remarks


def draw(figure: "Figure", found: Found) -> None:
    """Draw two views of the robot from above: the board's x and y axes, and the IMU's axes."""
    left, right = figure.subplots(1, 2)
    for axes in (left, right):
        axes.add_artist(Circle((0.0, 0.0), 1.0, fill=False, color="0.7"))
        for name, bearing_rad in zip(WHEELS, WHEEL_BEARINGS_RAD, strict=True):
            axes.text(math.cos(bearing_rad), math.sin(bearing_rad), name, ha="center", va="center")
        axes.set(xlim=(-1.3, 1.3), ylim=(-1.3, 1.3), aspect="equal", xlabel="forward")
        axes.set_ylabel("left")
        axes.grid(alpha=0.3)
    left.set_title("The board's x and y")
    right.set_title("The IMU's axes")
    if found.axis_signs is None:
        _say(left, "not checked")
    else:
        x, y, yaw = found.axis_signs
        _arrow(left, (0.8 * x, 0.0), "x")
        _arrow(left, (0.0, 0.8 * y), "y")
        _say(left, f"yaw {'counter-' if yaw > 0 else ''}clockwise")
    if found.mounting is None:
        _say(right, "not checked")
    else:
        for name, column in zip("xyz", found.mounting.rotation.T, strict=True):
            if math.hypot(column[0], column[1]) > SEEN_FROM_ABOVE:
                _arrow(right, (0.8 * column[0], 0.8 * column[1]), name)
            else:
                _say(right, f"{name} points {'up' if column[2] > 0 else 'down'}")


def _arrow(axes: "Axes", tip: tuple[float, float], name: str) -> None:
    arrow = {"arrowstyle": "->", "color": COLOURS[name], "linewidth": 2}
    axes.annotate("", xy=tip, xytext=(0.0, 0.0), arrowprops=arrow)
    axes.text(1.15 * tip[0], 1.15 * tip[1], name, color=COLOURS[name], ha="center", va="center")


def _say(axes: "Axes", text: str) -> None:
    axes.text(0.0, -1.2, text, ha="center", va="center")
