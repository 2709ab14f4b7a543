# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The picture of ``calibrate geometry``."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from omnibot_driver.tools.calibrate.geometry_fit import Geometry, Reading, rolled
from omnibot_driver.tools.calibrate.log import Column

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw(
    figure: "Figure", readings: Sequence[Reading], found: Geometry, base_radius_m: float
) -> None:
    """Draw each drive's path with the old and the new geometry, and the end measured by tape.

    Also draw the errors of the ends, in standard deviations of the tape measurement.
    """
    left, right = figure.subplots(1, 2, width_ratios=(3, 2))
    placed = [one for one in readings if not np.isnan(one.end[:2]).any()]
    for number, one in enumerate(placed):
        colour = f"C{number}"
        was = rolled(one.path, np.ones(3), 1.0, base_radius_m)
        now = _with(one, found, base_radius_m)
        left.plot(was[:, 0], was[:, 1], ":", color=colour)
        left.plot(now[:, 0], now[:, 1], color=colour, label=one.name)
        left.errorbar(*one.end[:2], *one.sigma[:2], fmt="x", ms=9, mew=2, color=colour)
    left.plot([], [], ":", color="grey", label="path by odom, old geometry")
    left.plot([], [], "x", color="grey", label="end by the tape")
    left.set(title="Path by odom, new geometry", xlabel="forward, m", ylabel="left, m")
    left.set_aspect("equal")
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    labels, before, after = [], [], []
    for one in readings:
        was = rolled(one.path, np.ones(3), 1.0, base_radius_m)[-1]
        now = _with(one, found, base_radius_m)[-1]
        for axis, what in enumerate(("x", "y", "heading")):
            if not np.isnan(one.end[axis]):
                labels.append(f"{one.name}, {what}")
                before.append(abs(was[axis] - one.end[axis]) / one.sigma[axis])
                after.append(abs(now[axis] - one.end[axis]) / one.sigma[axis])
    rows = np.arange(len(labels))
    right.barh(rows - 0.2, before, 0.4, color="tab:grey", label="before")
    right.barh(rows + 0.2, after, 0.4, color="tab:green", label="after")
    right.set_yticks(rows, labels, fontsize="small")
    right.invert_yaxis()
    right.set(
        title="Error of odom",
        xlabel="in standard deviations of the tape measurement",
        xscale="symlog",
    )
    right.legend()


def _with(reading: Reading, found: Geometry, base_radius_m: float) -> Column:
    factors = found.wheels * (1 + found.unlike)
    return rolled(reading.path, factors, found.base, base_radius_m)
