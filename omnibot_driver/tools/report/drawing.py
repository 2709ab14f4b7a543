# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Drawing functions that all pictures of the report share: colours, axes, lines of many points."""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from omnibot_driver.core.reporting.status import RUNNING
from omnibot_driver.tools.report.log import Array, Log

X, Y, Z, COMMAND, RED, GREY = "#0072B2", "#D55E00", "#009E73", "#222222", "#C0272D", "#8A8F98"
STATES: Final = {
    "nominal": "#7FC8A9",
    "imu_only": "#B9D67A",
    "paused": "#F2C14E",
    "connecting": "#F08A4B",
    "disconnected": "#8E6BB0",
}
WIDTH_IN: Final = 10.0
POINTS: Final = 3000
"""Largest number of points of a drawn line. If the data has more points, only extremes are drawn.
"""


def new_figure(height_in: float) -> Figure:
    """Return a new figure with the common width."""
    return Figure(figsize=(WIDTH_IN, height_in), layout="constrained")


def dress(axes: Axes, label: str, title: str = "") -> None:
    """Add grid, frame, label and title to the axes."""
    axes.set_ylabel(label)
    axes.grid(True, color="#E3E6EA", linewidth=0.7)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    if title:
        axes.set_title(title, loc="left", fontsize=11, fontweight="bold")


def legend(axes: Axes) -> None:
    """Draw the legend in the upper right corner of the axes."""
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="upper right", ncols=4, frameon=False, fontsize=9, borderaxespad=0.1)


def legend_below(axes: Axes) -> None:
    """Draw the legend below the axes."""
    if axes.get_legend_handles_labels()[0]:
        place = (0.5, -0.14)
        axes.legend(loc="upper center", bbox_to_anchor=place, ncols=3, frameon=False, fontsize=9)


def envelope(times_s: Array, values: Array) -> tuple[Array, Array]:
    """Return about 3000 points that keep the extremes of a longer line.

    A line of at most 3000 points is returned unchanged.
    """
    if len(times_s) <= POINTS:
        return times_s, values
    size = -(-len(times_s) // (POINTS // 2))
    rows = np.pad(values, (0, -len(values) % size), mode="edge").reshape(-1, size)
    both = np.sort(np.stack([rows.argmin(axis=1), rows.argmax(axis=1)], axis=1), axis=1)
    picked = (both + np.arange(len(rows))[:, None] * size).ravel()
    return times_s[picked], values[picked]


def line(axes: Axes, times_s: Array, values: Array, colour: str, label: str, **more: float) -> None:
    """Draw a line that is interrupted where the data has a gap."""
    times_s, values = envelope(times_s, values)
    if len(times_s) > 1:
        steps_s = np.diff(times_s)
        holes = np.flatnonzero(steps_s > max(1.0, 5 * float(np.median(steps_s)))) + 1
        times_s, values = np.insert(times_s, holes, np.nan), np.insert(values, holes, np.nan)
    axes.plot(times_s, values, color=colour, label=label, **{"linewidth": 1.1, **more})  # type: ignore[arg-type]


def dots(axes: Axes, times_s: Array, values: Array, colour: str, label: str) -> None:
    """Draw points. If there are too many, draw only the extremes and every n-th of the points."""
    every = -(-len(times_s) // POINTS) or 1
    extremes_s, extremes = envelope(times_s, values)
    times_s = np.concatenate([times_s[::every], extremes_s])
    values = np.concatenate([values[::every], extremes])
    axes.plot(times_s, values, ".", color=colour, markersize=2.5, label=label, alpha=0.7)


def shade(axes: Axes, log: Log) -> None:
    """Shade the times of a latched e-stop (red), and of states in which the board does not run."""
    for span in log.latched:
        axes.axvspan(span.begin_s, span.end_s, color=RED, alpha=0.18, linewidth=0)
    for span in log.states:
        if span.what not in RUNNING:
            colour = STATES.get(span.what, GREY)
            axes.axvspan(span.begin_s, span.end_s, color=colour, alpha=0.25, linewidth=0)


def time_axis(axes: Axes, log: Log) -> None:
    """Set the time axis to the whole log, and label it."""
    axes.set_xlim(0.0, max(log.duration_s, 1e-3))
    axes.set_xlabel("time in s")
