# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Formats a view of the robot as text and as JSON.

The module knows text; it must not know ROS, or where a text is shown.
"""

import json
import math
from collections.abc import Iterable
from dataclasses import asdict
from typing import Any, Final

from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.reporting.status import Level, Status
from omnibot_driver.tools.monitor.model import IMU_TOPIC, ODOM_TOPIC, Flow, View
from omnibot_driver.tools.monitor.plot import sparkline

WIDTH: Final = 7
BAR_COLUMNS: Final = 20
COUNTS: Final = (
    ("Stream", "Framing faults", "framing faults"),
    ("Stream", "Sequence gaps", "gaps"),
    ("Stream", "IMU frames lost", "IMU lost"),
    ("Stream", "Odometry frames lost", "odom lost"),
    ("Board", "Restarts", "restarts"),
    ("Link", "Reconnects", "reconnects"),
    ("Commands", "Refused", "refused"),
)


def clean(text: str) -> str:
    """Return the text with control characters replaced by question marks."""
    return "".join(char if char.isprintable() else "?" for char in text)


def number(value: float | None, places: int = 2) -> str:
    """Return the number as text in seven columns; a dash for None."""
    if value is None:
        return "–".rjust(WIDTH)
    if 999.9 < abs(value) < math.inf:
        return f"{value:{WIDTH}.0f}" if abs(value) < 99_999.0 else f"{value:{WIDTH}.0e}"
    return f"{round(value, places) + 0.0:{WIDTH}.{places}f}"  # + 0.0 makes a rounded -0.0 positive


def numbers(values: Iterable[float] | None) -> str:
    """Return three numbers as text; three dashes for None."""
    return " ".join(number(value) for value in (values or (None, None, None)))


def title(view: View) -> str:
    """Return the first line of the screen: driver, state and link."""
    if view.silent:
        return f"{view.driver}  silent for {view.silent_s:.0f} s (last state: {view.state})"
    return clean(f"{view.driver}  {view.state}  {view.link}".rstrip())


def estop(view: View) -> str:
    """Return the state of the e-stop as text."""
    if view.estop_asked:
        return "E-STOP REQUESTED, NOT YET CONFIRMED"
    if view.estop is None or (view.silent and not view.estop):
        return "e-stop: unknown"
    return "E-STOP LATCHED" if view.estop else "e-stop not latched"


def figures(view: View) -> list[str]:
    """Return rates, pose, velocities and IMU as lines of at most 42 columns."""
    inertial = [
        f"force     m/s²     {numbers(view.force_mps2)}",
        f"gyro      rad/s    {numbers(view.rate_radps)}",
    ]
    return [
        *(
            f"{name:<12}{flow.hz:5.0f} Hz  {sparkline(flow.history, BAR_COLUMNS)}"
            for name, flow in _flows(view).items()
        ),
        "                        x       y yaw or z",
        f"pose      m, °     {_pose(view)}",
        f"commanded m/s rad/s{numbers(_twist(view.commanded))}",
        f"measured  m/s rad/s{numbers(_twist(view.measured))}",
        *([] if "imu" in view.lacks else inertial),
    ]


def verdicts(view: View) -> list[tuple[Level, str]]:
    """Return the diagnostic statuses as levels and texts. All OK statuses share one text."""
    if not view.statuses:
        return [(Level.STALE, "no diagnostics received")]
    worst = sorted((s for s in view.statuses if s.level), key=_urgency, reverse=True)
    lines = [(s.level, clean(f"{s.name}: {s.message}")) for s in worst]
    if fine := [s.name for s in view.statuses if not s.level]:
        lines.append((Level.OK, clean(f"OK: {', '.join(fine)}")))
    return lines


def counts(view: View) -> str:
    """Return the driver's counts of faults since its start, as text without zero counts."""
    values = {(s.name, key): value for s in view.statuses for key, value in s.values.items()}
    happened = [
        f"{word} {values[name, key]}"
        for name, key, word in COUNTS
        if values.get((name, key), "0") != "0"
    ]
    if not view.statuses:
        return ""
    return clean(f"since driver start: {', '.join(happened) or 'nothing lost, nothing refused'}")


def report(view: View) -> str:
    """Return the whole view as text, for a terminal, a log or a pipe."""
    statuses = [clean(f"{s.name:<10}{s.level.name:<6}{s.message}") for s in view.statuses]
    lines = [title(view), estop(view), "", *figures(view), "", *statuses, counts(view)]
    return "\n".join(line.rstrip() for line in lines).rstrip() + "\n"


def as_json(view: View, troubles: Iterable[str]) -> str:
    """Return the view as JSON.

    JSON has no NaN and no infinity. A NaN or infinite value becomes null, and ``troubles`` names
    it.
    """
    inertial = {
        "imu": {
            "linear_acceleration_mps2": _finite(view.force_mps2),
            "angular_velocity_radps": _finite(view.rate_radps),
        }
    }
    return json.dumps(
        {
            "driver": view.driver,
            "state": view.state or None,
            "estop": view.estop,
            "rates_hz": {name: round(flow.hz, 1) for name, flow in _flows(view).items()},
            "pose": _fields(view.pose),
            "commanded": _fields(view.commanded),
            "measured": _fields(view.measured),
            **({} if "imu" in view.lacks else inertial),
            "diagnostics": {s.name: _status(s) for s in view.statuses},
            "troubles": list(troubles),
        },
        indent=2,
        ensure_ascii=False,
    )


def _flows(view: View) -> dict[str, Flow]:
    flows = {IMU_TOPIC: view.imu, ODOM_TOPIC: view.odom}
    return {
        name: flow for name, flow in flows.items() if name != IMU_TOPIC or "imu" not in view.lacks
    }


def _urgency(status: Status) -> int:
    return status.level % Level.STALE


def _pose(view: View) -> str:
    if view.pose is None:
        return numbers(None)
    yaw_rad = view.pose.yaw_rad
    if math.isfinite(yaw_rad):
        yaw_rad = math.remainder(yaw_rad, math.tau)
    return f"{numbers((view.pose.x_m, view.pose.y_m))} {number(math.degrees(yaw_rad), 1)}"


def _twist(twist: BodyTwist | None) -> tuple[float, float, float] | None:
    return (twist.vx_mps, twist.vy_mps, twist.yaw_rate_radps) if twist else None


def _status(status: Status) -> dict[str, Any]:
    return {
        "level": status.level.name,
        "message": status.message,
        "values": dict(status.values),
    }


def _fields(value: Any) -> dict[str, float | None] | None:
    if value is None:
        return None
    return {
        name: number if math.isfinite(number) else None for name, number in asdict(value).items()
    }


def _finite(values: Iterable[float] | None) -> list[float | None] | None:
    return None if values is None else [v if math.isfinite(v) else None for v in values]
