# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Measurements of the driver and the floor as processes on pseudo-terminals.

The floor is the smallest program with the same output, without any checks.
"""

import bisect
import json
import math
import struct
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from itertools import pairwise
from pathlib import Path
from statistics import median, quantiles
from tempfile import TemporaryDirectory
from typing import Final

from adapters import ADAPTERS
from processes import HERE, Program, driver, ear, floor, memory_mb, step
from ratios import Figure, alternate
from stage import Stage, number_of
from steps import STEPS

WINDOW_S = 6.0
"""Length of a measurement window, in s."""
COMMANDS_S = 3.0
SETTLING_S = 8.0
"""Time in s for which the programs run before the measurement.

The time is fixed, because no event reports that the programs are ready.
"""
GOALS: Final[dict[str, tuple[float | None, ...]]] = {
    "pieces of 1 to 16 bytes": (1.0, 1.0, 1.0, 1.0),
    "1 ms timer": (None, None, None, None),
    "16 ms timer": (None, 1.25, None, None),
    "whole ticks": (1.10, 1.25, 1.5, 1.10),
}
"""Largest allowed ratios of the driver to the floor, the smallest program with the same output.

Key: the adapter. None: no limit. Order: median and 99th percentile of the latency, processor time,
latency of cmd_vel.
"""
MPS2_PER_COUNT = 9.80665 / 16384


def measurements(adapter: str, windows: int) -> tuple[list[Figure], str]:
    """Measure the latency from pseudo-terminal to callback, the processor time, and the memory."""
    with Stage(2, ADAPTERS[adapter]) as stage, ExitStack() as stack:
        listener = stack.enter_context(ear("ours", "floor"))
        programs = [
            stack.enter_context(driver(stage.paths[0], "ours")),
            stack.enter_context(floor("measurements", stage.paths[1], "floor")),
        ]
        time.sleep(SETTLING_S)
        marks = [time.monotonic()]
        busy = [[program.busy_s for program in programs]]
        resident_mb = [programs[0].resident_mb]
        for _ in range(windows):
            time.sleep(WINDOW_S)
            marks.append(time.monotonic())
            busy.append([program.busy_s for program in programs])
            resident_mb.append(programs[0].resident_mb)
        heard = listener.result()["heard"]
    units = (MPS2_PER_COUNT, 1.0)
    late = [latencies(*each) for each in zip(stage.said, heard, units, strict=True)]
    windowed = [
        [[us for at, us in each if start <= at < end] for each in late]
        for start, end in pairwise(marks)
    ]
    median_goal, p99_goal, busy_goal, _ = GOALS[adapter]
    figures = [
        Figure(
            f"{adapter}: IMU frame to callback, {name}",
            "µs",
            *zip(*values, strict=True),
            goal=goal,
        )
        for name, goal, of in (
            ("median", median_goal, _median),
            ("99th percentile", p99_goal, p99),
        )
        if (values := [[of(each) for each in window] for window in windowed])
    ]
    spent = [
        [1e3 * (after - before) / (end - start) for before, after in zip(*pair, strict=True)]
        for *pair, start, end in zip(busy, busy[1:], marks, marks[1:], strict=False)
    ]
    name = f"{adapter}: processor time per second of stream"
    figures.append(Figure(name, "ms", *zip(*spent, strict=True), goal=busy_goal))
    delivered = [sum(map(len, column)) for column in zip(*windowed, strict=True)]
    minutes = (marks[-1] - marks[0]) / 60
    memory = (
        f"Node: resident memory was {resident_mb[0]:.1f} MB at first, and {resident_mb[-1]:.1f} MB"
        f" after {minutes:.1f} minutes of {adapter}. In this time, {delivered[0]:,} of"
        f" {100 * (marks[-1] - marks[0]):,.0f} IMU frames arrived (floor: {delivered[1]:,})."
    )
    return figures, memory


def memory() -> list[str]:
    """Return the rows of a table: memory of driver, guard, and a node with the same interface."""
    with Stage(2) as stage, ExitStack() as stack:
        stack.enter_context(ear("ours"))
        ours = stack.enter_context(driver(stage.paths[0], "ours"))
        bare = stack.enter_context(floor("bare", stage.paths[1], "floor"))
        time.sleep(SETTLING_S)
        (guard,) = ours.children
        mine, its, least = (memory_mb(pid) for pid in (ours.process.pid, guard, bare.process.pid))
    rows = ["| process | resident | proportional | to the bare node |", "|---|---|---|---|"]
    for name, (resident, share) in (("bare node", least), ("driver", mine), ("guard", its)):
        ratios = f"{resident / least[0]:.2f}, {share / least[1]:.2f}"
        cells = f"{resident:.1f} MB | {share:.1f} MB | {ratios}"
        rows.append(f"| {name} | {cells} |")
    return rows


def steps(windows: int) -> list[str]:
    """Return table rows with each program's costs relative to the floor, from floor to driver.

    The floor is the smallest program with the driver's output. Each program after the floor, a
    relay, has one more task.
    """
    names = ["floor", *STEPS, "ours"]
    with Stage(len(names)) as stage, ExitStack() as stack:
        listener = stack.enter_context(ear(*names))
        paths = dict(zip(names, stage.paths, strict=True))
        programs = [
            stack.enter_context(floor("measurements", paths["floor"], "floor")),
            *(stack.enter_context(step(each, paths[each], each)) for each in STEPS),
            stack.enter_context(driver(paths["ours"], "ours")),
        ]
        time.sleep(SETTLING_S)
        marks, busy = [time.monotonic()], [[program.busy_s for program in programs]]
        for _ in range(windows):
            time.sleep(WINDOW_S)
            marks.append(time.monotonic())
            busy.append([program.busy_s for program in programs])
        heard = listener.result()["heard"]
    units = (1.0, *(MPS2_PER_COUNT,) * (len(names) - 1))
    late = [latencies(*each) for each in zip(stage.said, heard, units, strict=True)]
    least = [
        [_median([us for at, us in each if start <= at < end]) for each in late]
        for start, end in pairwise(marks)
    ]
    spent = [[b - a for a, b in zip(*pair, strict=True)] for pair in pairwise(busy)]
    rows = ["| relay | latency, median | processor time |", "|---|---|---|"]
    told = ["the floor", *(f"+ {text}" for text, _, _ in STEPS.values()), "the driver"]
    for number, text in enumerate(told):
        latency, time_ = (
            median(window[number] / window[0] for window in each) for each in (least, spent)
        )
        rows.append(f"| {text} | {latency:.2f} | {time_:.2f} |")
    return rows


def commands(adapter: str, windows: int) -> Figure:
    """Measure the time from a published cmd_vel to its bytes at the board."""
    with Stage(2, ADAPTERS[adapter]) as stage, ExitStack() as stack:
        stack.enter_context(driver(stage.paths[0], "ours"))
        stack.enter_context(floor("commands", stage.paths[1], "floor"))
        time.sleep(SETTLING_S)
        seconds = str(windows * COMMANDS_S)
        hand = stack.enter_context(Program(str(HERE / "hand.py"), seconds, "ours", "floor"))
        sent = hand.result()
    late = [command_latencies(*each) for each in zip(sent, stage.heard, strict=True)]
    size = min(map(len, late)) // windows
    parts = [[median(each[n * size : (n + 1) * size]) for n in range(windows)] for each in late]
    name = f"{adapter}: cmd_vel to the board's side, median"
    return Figure(name, "µs", *parts, goal=GOALS[adapter][3])


def imports(times: int) -> Figure:
    """Measure the time to import the driver, and the time to import what any ROS node needs."""
    floor_names = "rclpy, geometry_msgs.msg, nav_msgs.msg, sensor_msgs.msg, std_srvs.srv"

    def seconds(names: str) -> float:
        begun = time.monotonic()
        subprocess.run([sys.executable, "-c", f"import {names}"], check=True)
        return time.monotonic() - begun

    ours, least = partial(seconds, "omnibot_driver.node"), partial(seconds, floor_names)
    return alternate("importing", "s", ours, least, times=times)


def starts(times: int) -> Figure:
    """Measure the time from the start of the driver to the first Imu in another process."""
    taken: list[list[float]] = [[], []]
    for _ in range(times):
        for number, name in enumerate(("ours", "floor")):
            with Stage(1) as stage, ear(name) as listener:
                begun = time.monotonic()
                path = stage.paths[0]
                ours = number == 0
                with driver(path, name) if ours else floor("measurements", path, name):
                    time.sleep(SETTLING_S)
                    taken[number].append(listener.result()["heard"][0][0][0] - begun)
    return Figure("command to first Imu", "s", *taken)


def scale(counts: Sequence[int], seconds: float) -> list[str]:
    """Return the rows of a table: the cost of many drivers together, each with its own board."""
    rows = [
        "| drivers | ms per robot and second | of one alone | IMU Hz, least | odom Hz, least |",
        "|---" * 5 + "|",
    ]
    alone_ms = 0.0
    for count in counts:
        names = [f"robot{number}" for number in range(count)]
        with Stage(count) as stage, ExitStack() as stack:
            listener = stack.enter_context(ear(*names))
            drivers = [
                stack.enter_context(driver(path, name))
                for path, name in zip(stage.paths, names, strict=True)
            ]
            time.sleep(SETTLING_S + 2.0 * count)
            before, start = [each.busy_s for each in drivers], time.monotonic()
            time.sleep(seconds)  # all that happens in this time is measured
            after, end = [each.busy_s for each in drivers], time.monotonic()
            result = listener.result()
        each_ms = 1e3 * (sum(after) - sum(before)) / count / (end - start)
        alone_ms = alone_ms or each_ms
        imu, odometry = (
            min(sum(start <= at < end for at, *_ in each) for each in heard) / (end - start)
            for heard in (result["heard"], result["odometries"])
        )
        rows.append(
            f"| {count} | {each_ms:.1f} | {each_ms / alone_ms:.2f} | {imu:.1f} | {odometry:.1f} |"
        )
    return rows


def split(seconds: float) -> list[str]:
    """Return the rows of a table: the driver's processor time in each stage."""
    with TemporaryDirectory() as folder, Stage(1) as stage, ear("ours") as listener:
        told = Path(folder) / "split"
        before = f"import sys; sys.path.insert(0, {str(HERE)!r}); import split"
        with driver(stage.paths[0], "ours", before, SPLIT=str(told)) as program:
            time.sleep(SETTLING_S)
            busy_s = program.busy_s
            time.sleep(seconds)  # all that happens in this time is measured
            spent_s = program.busy_s - busy_s
            listener.result()
        stages = json.loads(told.read_text())
    rows = ["| stage | ms per second of stream | part |", "|---|---|---|"]
    passed_s = stages.pop("passed")
    per_second = {name: 1e3 * value / passed_s for name, value in stages.items()}
    total = 1e3 * spent_s / seconds
    per_second["everything else (executor, pacer, guard, DDS threads)"] = total - sum(
        per_second.values()
    )
    for name, value in per_second.items():
        rows.append(f"| {name} | {value:.2f} | {value / total:.0%} |")
    return [*rows, f"| all | {total:.2f} | |"]


def latencies(
    said: Sequence[float], heard: Sequence[tuple[float, float]], unit: float
) -> list[tuple[float, float]]:
    """Return, for each message, the delivery time of its frame in s, and its latency in µs.

    The value in a message is the number of its frame, multiplied by ``unit``.
    """
    found = []
    for at, value in heard:
        number = round(value / unit)
        tick = bisect.bisect_right(said, at) - 1
        for earlier in range(tick, max(-1, tick - 200), -1):
            if number_of(earlier) == number:
                found.append((said[earlier], 1e6 * (at - said[earlier])))
                break
    return found


def command_latencies(
    sent: Sequence[tuple[float, int]], heard: Sequence[tuple[float, bytes]]
) -> list[float]:
    """Return, for each command, the time in µs from its sending until the board reads its frame."""
    found = []
    frames = [
        (at, struct.unpack_from(">h", data, begin + 3)[0])
        for at, data in heard
        for begin in range(0, len(data) - 8)
        if data[begin : begin + 3] == b"\xff\xfe\x01"
    ]
    times = [at for at, _ in frames]
    for at, speed in sent:
        for arrived, number in frames[bisect.bisect_left(times, at) :][:10]:
            if number == speed:
                found.append(1e6 * (arrived - at))
                break
    return found


def _median(values: Sequence[float]) -> float:
    return median(values) if values else math.nan


def p99(values: Sequence[float]) -> float:
    return quantiles(values, n=100)[98] if len(values) > 1 else math.nan
