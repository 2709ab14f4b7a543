# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Draws the pictures of a log. Each function returns one figure, without a screen or ROS."""

from collections.abc import Iterable, Iterator
from itertools import cycle, zip_longest
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from omnibot_driver.tools.report import commanded, events, rhythm, sensing, streams, travel
from omnibot_driver.tools.report.drawing import (
    COMMAND,
    GREY,
    POINTS,
    RED,
    STATES,
    X,
    Y,
    Z,
    dots,
    dress,
    legend,
    legend_below,
    line,
    new_figure,
    shade,
    time_axis,
)
from omnibot_driver.tools.report.log import COMMAND_TIMEOUT_S, Array, Log, Series, Span, Status

HOLE_S: Final = 1.0
"""Length of a gap in the odometry, in s, above which the drawn path is interrupted."""
LEVELS: Final = ("#7FC8A9", "#F2C14E", "#C0272D", "#C9CDD3")
SHORT_WAY_M: Final = 0.05
ARROWS: Final = 24
SHOWN: Final = 1.5
"""Range of a timing plot: this factor times the value below which 99 % of the plotted magnitudes
lie. Values beyond the range are drawn at the edge."""


def path(log: Log) -> Figure:
    """Draw two pictures side by side: the path from above, and x, y and yaw over time.

    The colour of the path shows the time.
    """
    figure = new_figure(5.2)
    left, right = np.ravel(np.asarray(figure.subfigures(1, 2, width_ratios=(1.2, 1.0))))
    above = left.subplots()
    odom = log.odom.only(log.odom.finite)
    x, y, yaw = odom.values[:, :3].T
    every = max(1, len(odom) // POINTS)
    points = np.stack([x[::every], y[::every]], axis=1)
    unknown = travel.steps(odom).leap | (np.diff(odom.stamp_s) > HOLE_S)
    joined = np.diff(np.insert(np.cumsum(unknown), 0, 0)[::every]) == 0
    lines = LineCollection(
        list(np.stack([points[:-1], points[1:]], axis=1)[joined]), cmap="viridis", linewidths=2.5
    )
    lines.set_array(odom.stamp_s[::every][:-1][joined])
    above.add_collection(lines)
    above.set_aspect("equal", adjustable="datalim")
    above.autoscale_view()
    way_m = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    if way_m[-1] > SHORT_WAY_M:
        rows = np.searchsorted(way_m, np.linspace(0.0, way_m[-1], ARROWS + 2)[1:-1])
        above.quiver(
            *(x[rows], y[rows], np.cos(yaw[rows]), np.sin(yaw[rows])),
            **{"color": COMMAND, "scale": 18, "width": 0.005, "zorder": 3, "pivot": "mid"},
        )
    for row, name, colour in ((0, "begin", Z), (-1, "end", RED)):
        above.plot(x[row], y[row], "o", color=colour, markersize=9, zorder=4, label=name)
    above.margins(0.12)
    dress(above, "y in m", "Path in odom; arrows show the heading")
    above.set_xlabel("x in m")
    legend_below(above)
    left.colorbar(lines, ax=above, shrink=0.8, pad=0.02, label="time in s")
    axes_of = right.subplots(3, 1, sharex=True)
    unwrapped = np.degrees(np.unwrap(yaw))
    for axes, label, values, colour in zip(
        axes_of, ("x in m", "y in m", "yaw in °"), (x, y, unwrapped), (X, Y, Z), strict=True
    ):
        line(axes, odom.stamp_s, values, colour, "")
        shade(axes, log)
        dress(axes, label)
    time_axis(axes_of[-1], log)
    return figure


def velocities(log: Log) -> Figure:
    """Draw commanded and measured velocities, one plot for each axis."""
    found = commanded.shown(log)
    rows = sum(len(pair.axes) for pair in found)
    figure = new_figure(1.9 * rows)
    grid = np.atleast_1d(figure.subplots(rows, 1, sharex=True))
    free = iter(grid)
    for pair in found:
        times_s = pair.measured.stamp_s
        edges = np.unique(np.concatenate([pair.commands.arrived_s, times_s]))
        told = pair.commands.held(edges) if len(pair.commands) else None
        for axis, colour in zip(range(len(pair.axes)), cycle((X, Y, Z)), strict=False):
            axes = next(free)
            shade(axes, log)
            line(axes, times_s, pair.measured.values[:, axis], colour, "measured")
            if told is not None:
                line(axes, edges, told[:, axis], COMMAND, "commanded", linewidth=0.9, alpha=0.8)
            title = f"{pair.topic}: commanded and measured" if axis == 0 else ""
            dress(axes, f"{pair.axes[axis]} in {pair.units[axis]}", title)
            axes.margins(y=0.25)
            if axis == 0:
                legend(axes)
    time_axis(grid[-1], log)
    return figure


def inertia(log: Log) -> Figure:
    """Draw the IMU's angular velocity, and its specific force minus the median of each axis."""
    figure = new_figure(5.0)
    rows = figure.subplots(2, 1, sharex=True)
    imu = log.imu.only(log.imu.finite)
    middle = np.median(imu.values, axis=0) * ([0.0] * 3 + [1.0] * 3)
    for axes, first, unit, title in (
        (rows[0], 0, "rad/s", "Angular velocity, in the sensor's axes"),
        (rows[1], 3, "m/s²", "Specific force minus its median"),
    ):
        shade(axes, log)
        for column, colour in zip(range(first, first + 3), (X, Y, Z), strict=True):
            label = "xyz"[column % 3] + (f" (median {middle[column]:+.2f})" if first else "")
            values = imu.values[:, column] - middle[column]
            line(axes, imu.stamp_s, values, colour, label, linewidth=0.8)
        dress(axes, unit, title)
        axes.margins(y=0.25)
        legend(axes)
    time_axis(rows[1], log)
    return figure


def spectra(log: Log) -> Figure:
    """Draw the amplitude spectral density of the IMU's readings, at rest and in motion."""
    figure = new_figure(4.2)
    columns = figure.subplots(1, 2)
    imu = log.imu.only(log.imu.finite & np.isfinite(log.imu.stamp_s))
    rest = sensing.at_rest(log, imu)
    for axes, first, unit, title in (
        (columns[0], 0, "rad/s/√Hz", "Gyro"),
        (columns[1], 3, "m/s²/√Hz", "Accelerometer"),
    ):
        for rows, width, style in ((rest, 0.8, "--"), (~rest, 1.3, "-")):
            found = sensing.spectrum(imu, rows)
            if found is None:
                continue
            for column, colour in enumerate((X, Y, Z)):
                name = f"{'xyz'[column]} {'at rest' if style == '--' else 'in motion'}"
                density = found.density[:, first + column]
                axes.semilogy(
                    found.frequency_hz, density, style, color=colour, linewidth=width, label=name
                )
        dress(axes, unit, title)
        axes.set_xlabel("frequency in Hz")
        if len(imu) > 1:
            axes.set_xlim(0.0, sensing.rate_hz(imu) / 2)
        legend_below(axes)
    return figure


def timing(log: Log) -> Figure:
    """Draw how evenly messages are timed.

    First row: steps between successive timestamps, minus the median step. Second row: delays of
    arrival, minus the smallest delay.
    """
    figure = new_figure(5.6)
    grid = figure.subplots(2, 2, width_ratios=(2.6, 1.0), sharey="row")
    names: list[tuple[str, str]] = []
    told: tuple[list[tuple[Array, Array]], ...] = ([], [])
    for stream, series, colour in ((streams.IMU, log.imu, X), (streams.ODOMETRY, log.odom, Y)):
        found = rhythm.measure(log, series, stream)
        if len(found.steps_s):
            names.append((stream.name, colour))
            told[0].append((found.at_s, 1e3 * (found.steps_s - found.period_s)))
            told[1].append((found.arrived_s, 1e3 * (found.late_s - found.late_s.min())))
    for row in (0, 1):
        spreads = [float(np.quantile(np.abs(values), 0.99)) for _, values in told[row]]
        high = max(0.05, SHOWN * max(spreads, default=0.0))
        low = -high if row == 0 else 0.0
        for (name, colour), (times_s, values) in zip(names, told[row], strict=True):
            values = np.clip(values, low, high)
            dots(grid[row, 0], times_s, values, colour, name)
            bins = list(np.linspace(low, high, 61))
            grid[row, 1].hist(
                values, bins, orientation="horizontal", color=colour, alpha=0.55, density=True
            )
        grid[row, 0].set_ylim(low - 0.04 * (high - low), high + 0.18 * (high - low))
    dress(grid[0, 0], "ms", "Step between two stamps, minus the median step")
    dress(grid[1, 0], "ms", "Delay of arrival, minus the smallest delay")
    for axes in grid[:, 1]:
        dress(axes, "", "Distribution")
        axes.set_xticks([])
    for axes in grid[:, 0]:
        shade(axes, log)
        time_axis(axes, log)
        axes.legend(loc="upper right", frameon=False, fontsize=9, markerscale=4, ncols=2)
    return figure


def timeline(log: Log) -> Figure:
    """Draw state, e-stop, commands, gaps, and each status of /diagnostics as bands over time."""
    gaps = [
        (f"gaps in {stream.name}", rhythm.measure(log, series, stream))
        for stream, series in ((streams.IMU, log.imu), (streams.ODOMETRY, log.odom))
        if len(series) > 1
    ]
    names = list(dict.fromkeys((status.hardware_id, status.name) for status in log.diagnostics))
    rows = 4 + len(gaps) + len(names)
    figure = new_figure(0.8 + 0.3 * rows)
    axes = figure.subplots()
    labels: list[str] = []

    def band(label: str, spans: Iterable[tuple[Span, str]]) -> None:
        of_colour: dict[str, list[tuple[float, float]]] = {}
        for span, colour in spans:
            width_s = max(span.length_s, log.duration_s / 500)
            of_colour.setdefault(colour, []).append((span.begin_s, width_s))
        for colour, bars in of_colour.items():
            axes.broken_barh(bars, (len(labels) - 0.36, 0.72), color=colour, linewidth=0)
        labels.append(label)

    band("state", ((span, STATES.get(span.what, GREY)) for span in log.states))
    _name_states(axes, log)
    colours = {"latched": RED, "free": LEVELS[0]}
    band("e-stop", ((span, colours[span.what]) for span in log.estops))
    for name, series in (("cmd_vel", log.cmd_vel), ("wheel_cmd", log.wheel_cmd)):
        band(name, ((span, X) for span in _stretches(series)))
    for name, found in gaps:
        ends = zip(found.gap_at_s, found.gap_s, strict=True)
        band(name, ((Span(at, at + length, ""), RED) for at, length in ends))
    for hardware_id, name in names:
        told = [
            item for item in log.diagnostics if (item.hardware_id, item.name) == (hardware_id, name)
        ]
        band(name.rpartition(": ")[2], _said(told))
    axes.set_yticks(range(len(labels)), labels)
    axes.set_ylim(len(labels) - 0.4, -0.6)
    axes.yaxis.set_tick_params(length=0)
    dress(axes, "", "State, stops, commands, gaps and /diagnostics")
    axes.xaxis.set_major_locator(MaxNLocator(10))
    time_axis(axes, log)
    return figure


def _said(told: list[Status]) -> Iterator[tuple[Span, str]]:
    """Yield a span of time and a colour for each message of a diagnostic status.

    A span ends at the next message or, if none comes within 2 s, after 1 s.
    """
    for item, after in zip_longest(told, told[1:]):
        end_s = item.at_s + 1.0
        if after is not None and after.at_s - item.at_s < events.SILENT_S:
            end_s = after.at_s
        yield Span(item.at_s, end_s, ""), LEVELS[min(item.level, 3)]


def _name_states(axes: Axes, log: Log) -> None:
    for span in log.states:
        if span.length_s > 0.08 * log.duration_s:
            middle_s = (span.begin_s + span.end_s) / 2
            axes.text(middle_s, 0, span.what, ha="center", va="center", fontsize=9)


def _stretches(series: Series) -> list[Span]:
    """Return the spans of time in which commands arrived.

    A span ends if the next command comes more than 0.5 s later, or does not come.
    """
    if not len(series):
        return []
    times_s = series.arrived_s
    breaks = np.flatnonzero(np.diff(times_s) > COMMAND_TIMEOUT_S)
    begins = times_s[np.concatenate([[0], breaks + 1])]
    ends = times_s[np.concatenate([breaks, [len(times_s) - 1]])]
    return [Span(begin, end, "") for begin, end in zip(begins, ends, strict=True)]
