"""What ``calibrate commission`` found, for the table, the file and the reader."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from omnibot_driver.parameters import Value
from omnibot_driver.tools.calibrate.mounting import Mounting
from omnibot_driver.tools.calibrate.result import Finding, Result
from omnibot_driver.tools.calibrate.seen import Pattern, mirrored

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(slots=True)
class Found:
    """``before``: the driver's parameters; the rest is None until it is found."""

    before: dict[str, Any]
    control_method: str | None = None
    delta_frame: str | None = None
    wheel_signs: Pattern | None = None
    axis_signs: Pattern | None = None
    mounting: Mounting | None = None


def result_of(found: Found) -> Result:
    """Parameters for the driver; the IMU's mounting is for the robot's description."""
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
            "The driver does not turn the IMU's axes, the robot's description does: start"
            f" description.launch.py with xacro_args:=\"imu_rpy:='{words}'\""
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
            "With the switch on positional control the driver takes cmd_pose alone. For velocities"
            " move the switch, reboot the board and begin again."
        )
    if found.wheel_signs == (-1, -1, -1):
        remarks.append(
            "All wheels turn the other way than the manual says: axis_signs mends cmd_vel and odom;"
            " wheel_cmd and joint_states stay reversed."
        )
    if found.axis_signs is not None and mirrored(found.axis_signs):
        remarks.append(
            "These signs are a mirror image, which no choice of the front explains. If you are sure"
            " of what you saw, they are right for velocities; cmd_pose refuses them."
        )
    if found.delta_frame not in (None, found.before["delta_frame"]):
        remarks.append(
            "delta_frame is read at the start: start the driver with this file, then run `calibrate"
            " commission --only board` to see that it is right."
        )
    return remarks


def draw(figure: "Figure", found: Found) -> None:
    """The sensor's axes in the body, from above and from the side; or what was found in words."""
    if found.mounting is None:
        lines = [f"{name}: {getattr(found, name)}" for name in ("control_method", "delta_frame")]
        lines.append(f"axis_signs: {found.axis_signs}")
        figure.text(0.1, 0.5, "\n".join(lines), fontsize=14)
        return
    axes: Any = figure.subplots(1, 2)
    views = (
        ("from above", 0, 1, "forward x", "left y"),
        ("from the right", 0, 2, "forward x", "up z"),
    )
    for place, (view, right, upward, across, along) in zip(axes, views, strict=True):
        for number, (name, colour) in enumerate(zip("xyz", ("C3", "C2", "C0"), strict=True)):
            column = found.mounting.rotation[:, number]
            tip = np.array([column[right], column[upward]])
            place.annotate(
                "", xy=tuple(tip), xytext=(0, 0), arrowprops={"arrowstyle": "->", "color": colour}
            )
            if np.linalg.norm(tip) > 0.3:
                place.text(*(1.1 * tip), name, color=colour, ha="center", va="center")
        place.add_artist(_circle())
        place.set(xlim=(-1.3, 1.3), ylim=(-1.3, 1.3), aspect="equal")
        place.set(title=f"The IMU's axes {view}", xlabel=across, ylabel=along)
        place.grid(alpha=0.3)


def _circle() -> Any:
    from matplotlib.patches import Circle

    return Circle((0.0, 0.0), 1.0, fill=False, color="0.8")
