# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A test rig: a simulated board, a real driver, and a user who answers.

The board has planted errors, which a calibration must find.
"""

import math
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
import yaml
from driver_process import PATIENCE_S, Driver
from probe import leave_events_out

from omnibot_driver.simulator.omnibot import BoardSettings, PtyBoard, SimulatedBoard
from omnibot_driver.tools.calibrate import client, listener, motion
from omnibot_driver.tools.calibrate import robot as robot_module
from omnibot_driver.tools.calibrate.__main__ import main
from omnibot_driver.tools.calibrate.connection import connect
from omnibot_driver.tools.calibrate.interruption import Interruption
from omnibot_driver.tools.calibrate.robot import Robot

Answer = Callable[[str], str]

BUSY_S = 3.0
"""Timeout of commands and data in s, so long that a busy test machine seldom exceeds it."""
ATTEMPTS = 5
STALLED = "driver stalled for"
OVERLOADED = ("did not run for", "not overloaded", "no odometry arrives", "does not answer")
"""Texts in the tool's error messages that show that the computer is too busy.

``STALLED`` is the text in the driver's log that shows the same.
"""


def yes(_question: str) -> str:
    return "y"


@dataclass
class Rig:
    """A simulated board with a driver. Calibrations write their files to ``folder``."""

    port: PtyBoard
    driver: Driver
    folder: Path
    questions: list[str] = field(default_factory=list)

    @property
    def output(self) -> Path:
        return self.folder / "robot.yaml"

    def calibrate(self, *words: str, answer: Answer = yes, draws: bool = True) -> int:
        """Run a calibration in this process, and return its exit code.

        ``draws``: whether to draw the picture, which takes a second. A calibration that fails
        because the computer was too busy is repeated.
        """

        def read(question: str) -> str:
            self.questions.append(question)
            return answer(question)

        files = ("--output", str(self.output), "--plot", str(self.folder))
        for _ in range(ATTEMPTS):
            since, errors = len(self.driver.lines), StringIO()
            with redirect_stderr(errors), pytest.MonkeyPatch.context() as patch:
                if not draws:
                    patch.setattr("omnibot_driver.tools.calibrate.files.draw", lambda *_: None)
                code = main([*words, *files, "--namespace", self.driver.namespace], read)
            print(errors.getvalue(), file=sys.stderr, end="")
            was_busy = any(STALLED in line for line in self.driver.lines[since:]) or any(
                text in errors.getvalue() for text in OVERLOADED
            )
            if code != 1 or not was_busy:
                break
        return code

    def written(self) -> dict[str, Any]:
        """Return the content of the calibration file that was written."""
        content: dict[str, Any] = yaml.safe_load(self.output.read_text())
        return content


@contextmanager
def rig(
    folder: Path, parameters: dict[str, object] | None = None, **settings: Any
) -> Iterator[Rig]:
    """Run a simulated board with ``settings`` and a driver with ``parameters``. Yield the rig."""
    board = SimulatedBoard(BoardSettings(running=True, **settings))
    with (
        pytest.MonkeyPatch.context() as patch,
        PtyBoard(board) as port,
        Driver(port=port.path, **{"cmd_vel_timeout": BUSY_S, **(parameters or {})}) as driver,
    ):
        leave_events_out(patch)
        patch.setattr(listener, "LOST_S", BUSY_S)
        patch.setattr(motion, "LOOK_S", BUSY_S)
        for module, name in (
            (client, "FOUND_WITHIN_S"),
            (client, "ANSWER_WITHIN_S"),
            (listener, "FOUND_WITHIN_S"),
            (robot_module, "ANSWER_WITHIN_S"),
        ):
            patch.setattr(module, name, PATIENCE_S)
        driver.wait_for_line("state: nominal|state: imu_only")
        yield Rig(port, driver, folder)


@contextmanager
def robot_of(driver: Driver) -> Iterator[Robot]:
    """Connect to the driver as a calibration does, and yield the ``Robot`` of the calibration."""
    with Interruption() as interruption, connect(driver.namespace, [], interruption) as robot:
        yield robot


def parameters_of(driver: Driver) -> dict[str, Any]:
    """Return the parameters that the driver reports."""
    with robot_of(driver) as robot:
        return dict(robot.parameters)


def row(table: str, name: str) -> tuple[float, float]:
    """Return the value and the uncertainty in the row ``name`` of a printed table.

    An empty uncertainty is NaN.
    """
    found = re.search(rf"^[│ ]*{re.escape(name)} *│ *(\S+) *│ *(\S*) *│", table, re.MULTILINE)
    assert found, f"no row {name!r} in:\n{table}"
    return float(found[1]), float(found[2] or math.nan)
