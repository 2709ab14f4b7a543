# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The processes that the benchmark measures, and their processor time and memory from /proc."""

import json
import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

HERE = Path(__file__).parent
PATIENCE_S = 5.0


class Program:
    """A program of this directory, or a module, that runs as a process within a ``with`` block."""

    def __init__(self, *arguments: str, environment: dict[str, str] | None = None) -> None:
        self.process = subprocess.Popen(
            [sys.executable, *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env={**os.environ, **(environment or {})},
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.terminate()
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(PATIENCE_S)
        self.process.kill()
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            assert pipe is not None
            with suppress(OSError):
                pipe.close()

    def line(self) -> str:
        """Return the next line that the process prints."""
        assert self.process.stdout is not None
        return self.process.stdout.readline()

    def result(self) -> Any:
        """Close the process's input; return the value that the process then prints as JSON."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        return json.loads(self.line())

    @property
    def busy_s(self) -> float:
        """Return the processor time of the process with its threads and children so far, in s."""
        return _busy_s(self.process.pid)

    @property
    def resident_mb(self) -> float:
        """Return the resident memory of the process without its children, in MB."""
        return memory_mb(self.process.pid)[0]

    @property
    def children(self) -> list[int]:
        """Return the process ids of the process's children."""
        tasks = Path(f"/proc/{self.process.pid}/task").iterdir()
        return [int(pid) for task in tasks for pid in (task / "children").read_text().split()]


def driver(path: str, namespace: str, before: str = "", **environment: str) -> Program:
    """Start the driver on this port, as users do.

    ``before``: Python code that runs first in the driver's process.
    """
    program = ["-m", "omnibot_driver.driver"]
    if before:
        main = "import sys, omnibot_driver.driver as driver; sys.exit(driver.main())"
        program = ["-c", f"{before}\n{main}"]
    arguments = ["--ros-args", "-r", f"__ns:=/{namespace}", "-p", f"port:={path}"]
    return Program(*program, *arguments, environment=environment)


def floor(what: str, path: str, namespace: str) -> Program:
    """Start ``floor.py``, the smallest program with the same output as the driver.

    ``what``: the task of the program.
    """
    return Program(str(HERE / "floor.py"), what, path, namespace)


def step(what: str, path: str, namespace: str) -> Program:
    """Start ``steps.py``, a relay of a board's data that does some of the driver's tasks.

    ``what``: a key of ``STEPS`` in ``steps.py``. It selects the tasks that the relay does.
    """
    return Program(str(HERE / "steps.py"), what, path, namespace)


def ear(*namespaces: str) -> Program:
    """Start a process that subscribes in these namespaces, and wait until it is ready."""
    program = Program(str(HERE / "ear.py"), *namespaces)
    program.line()
    return program


def memory_mb(pid: int) -> tuple[float, float]:
    """Return the resident memory of a process, and its proportional set size, in MB."""
    rows = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    kb = {row.split()[0]: float(row.split()[1]) for row in rows[1:]}
    return kb["Rss:"] * 1.024e-3, kb["Pss:"] * 1.024e-3


def _busy_s(pid: int) -> float:
    busy_s = 0.0
    with suppress(FileNotFoundError, ProcessLookupError):  # threads and children may end meanwhile
        for task in Path(f"/proc/{pid}/task").iterdir():
            busy_s += int((task / "schedstat").read_text().split()[0]) / 1e9
            for child in (task / "children").read_text().split():
                busy_s += _busy_s(int(child))
    return busy_s
