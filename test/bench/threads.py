# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Processor time and wake-ups of each thread of the driver, from the kernel's counters."""

import time
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from processes import HERE, driver, ear
from stage import Stage
from system import SETTLING_S

LEAST_MS: Final = 0.05
"""Least processor time, in ms per second, with which a thread has its own row in the table."""

Counts = dict[str, tuple[float, int]]
"""For each name of a thread, the processor time in s and the number of wake-ups."""


def table(seconds: float) -> list[str]:
    """Return the rows of a table of the threads of driver and guard, and the page faults."""
    with TemporaryDirectory() as folder, Stage(1) as stage, ear("ours") as listener:
        names = Path(folder) / "names"
        before = f"import sys; sys.path.insert(0, {str(HERE)!r}); import thread_names"
        with driver(stage.paths[0], "ours", before, NAMES=str(names)) as program:
            time.sleep(SETTLING_S)
            pid, (guard,) = program.process.pid, program.children
            named = dict(line.split(maxsplit=1) for line in names.read_text().splitlines())
            begun, start, faults = _counts(pid, named, guard), time.monotonic(), _faults(pid)
            time.sleep(seconds)  # all that happens in this time is measured
            ended, passed_s = _counts(pid, named, guard), time.monotonic() - start
            faults = _faults(pid) - faults
            listener.result()
    rows = ["| thread | ms per second | wake-ups per second |", "|---" * 3 + "|"]
    others_ms = others = 0.0
    for name, (spent_s, wakes) in sorted(ended.items(), key=lambda each: -each[1][0]):
        before_s, before_wakes = begun.get(name, (0.0, 0))
        ms, rate = 1e3 * (spent_s - before_s) / passed_s, (wakes - before_wakes) / passed_s
        if ms < LEAST_MS:
            others_ms, others = others_ms + ms, others + rate
        else:
            rows.append(f"| {name} | {ms:.2f} | {rate:.0f} |")
    rows.append(f"| all others | {others_ms:.2f} | {others:.0f} |")
    return [*rows, "", f"Page faults of the driver: {faults / passed_s:.1f} per second."]


def _counts(pid: int, named: dict[str, str], guard: int) -> Counts:
    found: Counts = {}
    for task in [*Path(f"/proc/{pid}/task").iterdir(), Path(f"/proc/{guard}")]:
        with suppress(FileNotFoundError):  # a thread may end meanwhile
            name = named.get(task.name) or (task / "comm").read_text().strip()
            if task.name in (str(pid), str(guard)):
                name = "guard, a process" if task.name == str(guard) else "main"
            spent_ns, _, wakes = map(int, (task / "schedstat").read_text().split())
            before_s, before = found.get(name, (0.0, 0))
            found[name] = before_s + spent_ns / 1e9, before + wakes
    return found


def _faults(pid: int) -> int:
    """Return the number of a process's page faults without disk access (field 10 of ``stat``)."""
    return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[7])
