# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Picture of squares of 5 m that a simulated LOIS ECU drives: the true path, and ``odom``'s path.

With each firmware variant, the robot drives one square to the left and one to the right. The
program also prints ``odom``'s errors.
"""

import math
import sys
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parents[1] / "core" / "lois_ecu"))

from lois_drives import STOP, Rig, nominal
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.odometry.covariance import Covariance
from omnibot_driver.simulator.lois_ecu import QUIRKS, Firmware

SIDE_M = 5.0
SEED = 11
SIGMAS = 3


def main(folder: Path) -> None:
    """Write ``lois_squares.png``."""
    figure = Figure(figsize=(9.0, 9.0), layout="constrained")
    axes: Any = figure.subplots(2, 2, sharex="col", sharey=True)
    print("| Firmware | Square | Way | Off by | Largest error, in its standard deviations |")
    print("|---|---|---|---|---|")
    for row, firmware in zip(axes, QUIRKS, strict=True):
        for one, (name, sign) in zip(row, (("left", 1), ("right", -1)), strict=True):
            draw(one, firmware, name, sign)
    axes[0, 0].legend(fontsize=8, loc="center")
    figure.savefig(folder / "lois_squares.png", dpi=80)


def draw(axes: Any, firmware: Firmware, name: str, sign: int) -> None:
    """Plot one driven square, and the region in which the robot is expected at the end."""
    rig = Rig(nominal(firmware, SEED))
    rig.run(4.0)
    rig.square(SIDE_M, sign)
    rig.order(*STOP, 2.0)
    found = rig.outcome()
    error = found.error
    off_m = math.hypot(error.x_m, error.y_m)
    told = f"{off_m:.2f} m, {math.degrees(error.yaw_rad):+.1f}°"
    print(
        f"| {firmware} | {name} | {found.way_m:.1f} m | {told} | {found.sigmas:.1f} |", flush=True
    )
    true = [place for _, place in rig.estimates]
    axes.plot(*_columns(true), color="0.6", linewidth=2.5, label="the robot")
    axes.plot(*_columns([one.pose for one, _ in rig.estimates]), color="C0", label="odom")
    axes.add_patch(_region(found.last.pose, found.last.covariance))
    axes.plot(found.true.x_m, found.true.y_m, "o", color="0.4")
    axes.set_title(f"{firmware}, {name}: off by {told}", fontsize=10)
    axes.set_aspect("equal")
    axes.grid(alpha=0.3)
    axes.set_xlabel("x, m")


def _columns(poses: list[Pose]) -> tuple[list[float], list[float]]:
    return [pose.x_m for pose in poses], [pose.y_m for pose in poses]


def _region(pose: Pose, covariance: Covariance) -> Ellipse:
    mean = (covariance.xx + covariance.yy) / 2
    half = math.hypot((covariance.xx - covariance.yy) / 2, covariance.xy)
    angle = math.degrees(math.atan2(2 * covariance.xy, covariance.xx - covariance.yy) / 2)
    width, height = (2 * SIGMAS * math.sqrt(max(mean + part, 0.0)) for part in (half, -half))
    return Ellipse(
        (pose.x_m, pose.y_m), width, height, angle=angle, fill=False, color="C0", linewidth=0.8
    )
