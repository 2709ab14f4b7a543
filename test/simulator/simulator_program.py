# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The simulator as a separate program: functions to start it, type into its console and read it."""

import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import IO

import omnibot_driver

PATIENCE_S = 30.0
ROOT = Path(omnibot_driver.__file__).parents[1]
RUN_MODULE = (
    "import sys, importlib; from omnibot_driver.simulator.__main__ import run;"
    "name = sys.argv[1]; sys.exit(run(importlib.import_module(name), name, sys.argv[2:]))"
)


def simulator(
    *arguments: str, stdin: int | IO[str] = subprocess.PIPE
) -> AbstractContextManager[subprocess.Popen[str]]:
    """Run the simulator as a user does. Kill it if the test leaves it running."""
    return _running(["-m", "omnibot_driver.simulator", *arguments], stdin)


def toy(
    name: str, *arguments: str, stdin: int | IO[str] = subprocess.PIPE
) -> AbstractContextManager[subprocess.Popen[str]]:
    """Run the simulator with the toy board of the test module ``name``."""
    return _running(["-c", RUN_MODULE, name, *arguments], stdin)


@contextmanager
def _running(arguments: Sequence[str], stdin: int | IO[str]) -> Iterator[subprocess.Popen[str]]:
    path = os.pathsep.join((str(ROOT), str(Path(__file__).parent)))
    with subprocess.Popen(
        [sys.executable, *arguments],
        stdin=stdin,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": path},
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def line(process: subprocess.Popen[str]) -> str:
    """Return the next line that the simulator prints."""
    assert process.stdout is not None
    return process.stdout.readline().rstrip("\n")


def say(process: subprocess.Popen[str], text: str) -> None:
    """Type a line into the console."""
    assert process.stdin is not None
    process.stdin.write(text + "\n")
    process.stdin.flush()
