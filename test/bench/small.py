# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Measurement of the driver and the floor on a simulated small computer. Only root can run it.

The floor is the smallest program with the same output. Linux's cgroups give each program a share of
one core.
"""

import math
import os
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median
from typing import Final, Self

from processes import HERE, Program, driver, ear, floor
from stage import Stage
from system import MPS2_PER_COUNT, SETTLING_S, command_latencies, latencies, p99

PARTS: Final = (1.0, 0.25, 0.12, 0.08, 0.06, 0.05, 0.04)
"""Shares of one processor core with which the driver and the floor are each measured once.

The floor is the smallest program with the same output as the driver.
"""
MEASURED_S: Final = 8.0
RUN_S: Final = 1e-3
"""Processor time in s that a cgroup gets in each period. The kernel permits no shorter time."""
CGROUP: Final = Path("/sys/fs/cgroup")
NAMES: Final = ("ours", "floor")
RELAY: Final = "measurements"
STOP: Final = b"\xff\xfe\x02"
STOPPING_S: Final = 2.0
"""Time in s for which a measurement waits for a Stop after the last command.

This time does not depend on how much processor time the driver gets.
"""


class Group:
    """A group of processes that gets a share of one core, by version 1 or 2 of cgroups.

    Raises OSError if the cgroup cannot be set up.
    """

    def __init__(self, name: str) -> None:
        first = CGROUP / "cpu"
        self._is_first = first.is_dir()
        self._path = (first if self._is_first else CGROUP) / name
        self._members = self._path / "cgroup.procs"
        self._root = self._path.parent / "cgroup.procs"

    def __enter__(self) -> Self:
        self._path.mkdir()
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._members.read_text().split():
            self._root.write_text(process)
        self._path.rmdir()

    @contextmanager
    def joined(self) -> Iterator[None]:
        """Move the calling process into this group of processes for a ``with`` block.

        Processes that it starts in the block belong to the group, too.
        """
        self._members.write_text(str(os.getpid()))
        try:
            yield
        finally:
            self._root.write_text(str(os.getpid()))

    def give(self, part: float) -> None:
        """Limit this group of processes to the share ``part`` of one core (1: the whole core)."""
        run_us, period_us = round(1e6 * RUN_S), round(1e6 * RUN_S / part)
        if self._is_first:
            self._write("cpu.cfs_quota_us", -1)
            self._write("cpu.cfs_period_us", period_us)
            self._write("cpu.cfs_quota_us", run_us if part < 1 else -1)
        else:
            self._write("cpu.max", f"{run_us if part < 1 else 'max'} {period_us}")

    def _write(self, name: str, value: object) -> None:
        (self._path / name).write_text(str(value))


def table(parts: Sequence[float] = PARTS, seconds: float = MEASURED_S) -> list[str]:
    """Return table rows: results of driver and floor (the smallest relay) for each share of a core.

    ``seconds``: duration of the measurement with each share. If cgroups cannot be used, return a
    sentence with the reason.
    """
    try:
        return _table(parts, seconds)
    except OSError as error:
        return [f"Not measured, because only root can limit processor time: {error}."]


def _table(parts: Sequence[float], seconds: float) -> list[str]:
    everywhere = os.sched_getaffinity(0)
    measuring, computer = {min(everywhere)}, {max(everywhere)}
    rows = [
        "| part of a core | IMU Hz: driver, floor | odom Hz | IMU to callback, median (99 %), ms:"
        " driver | floor | cmd_vel to the board's side, ms | Stop after the last cmd_vel, s |",
        "|---" * 7 + "|",
    ]
    with ExitStack() as stack:
        stack.callback(os.sched_setaffinity, 0, everywhere)
        os.sched_setaffinity(0, measuring)
        stage = stack.enter_context(Stage(2))
        groups = [stack.enter_context(Group(f"bench-{name}-{os.getpid()}")) for name in NAMES]
        for group, name, path in zip(groups, NAMES, stage.paths, strict=True):
            os.sched_setaffinity(0, computer)
            with group.joined():
                ours = name == "ours"
                stack.enter_context(driver(path, name) if ours else floor(RELAY, path, name))
            os.sched_setaffinity(0, measuring)
        time.sleep(SETTLING_S)
        for part in parts:
            for group in groups:
                group.give(part)
            rows.append(_row(part, stage, seconds))
            for group in groups:
                group.give(1.0)
    return rows


def _row(part: float, stage: Stage, seconds: float) -> str:
    with ear(*NAMES) as listener:
        with Program(str(HERE / "hand.py"), str(seconds), NAMES[0]) as hand:
            sent = hand.result()[0]
        time.sleep(STOPPING_S)
        result = listener.result()
    # Earlier data is not used, because the start of hand.py disturbs the other processes.
    start, last = sent[0][0], sent[-1][0]
    rates, delays = [], []
    for heard, said, unit in zip(result["heard"], stage.said, (MPS2_PER_COUNT, 1.0), strict=True):
        within = [each for each in heard if start <= each[0] < last]
        rates.append(f"{len(within) / (last - start):.0f}")
        delays.append(_delay([us for _, us in latencies(said, within, unit)]))
    odometries = sum(start <= at < last for (at,) in result["odometries"][0])
    on_board = [each for each in stage.heard[0] if each[0] >= start]
    stop = next((at - last for at, data in on_board if at > last and STOP in data), math.inf)
    cells = (
        f"{part:.0%}",
        ", ".join(rates),
        f"{odometries / (last - start):.1f}",
        *delays,
        _delay(command_latencies(sent, on_board)),
        f"{stop:.2f}",
    )
    return f"| {' | '.join(cells)} |"


def _delay(late_us: Sequence[float]) -> str:
    return f"{median(late_us) / 1e3:.2f} ({p99(late_us) / 1e3:.1f})" if late_us else "—"
