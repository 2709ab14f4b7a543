# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A board is its own folders: without them the rest works as before."""

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Final

import pytest

from omnibot_driver import boards

HOME: Final = Path(__file__).parents[1]
REMAINS: Final = (
    "test/core/commands/test_motion_interlock.py",
    "test/core/commands/test_set_point_stream.py",
    "test/core/geometry",
    "test/core/test_every_board.py",
    "test/core/timing/test_clock_fit.py",
    "test/simulator/common",
    "test/system/test_driver_toys.py::test_a_toy_drives_and_is_heard",
    "test/test_transit.py",
    "test/transports/test_simulated.py",
    "test/transports/test_udp.py",
)
"""Tests of what all boards share."""


@pytest.mark.parametrize("board", boards.PROFILES)
def test_without_the_folders_of_one_board_the_tests_of_the_rest_are_green(
    board: str, tmp_path: Path
) -> None:
    """The folders are removed in a copy."""
    ignored = shutil.ignore_patterns(board, f"{board}.py", f"{board}_*.py", "__pycache__")
    for folder in ("omnibot_driver", "test"):
        shutil.copytree(HOME / folder, tmp_path / folder, ignore=ignored)
    shutil.copy(HOME / "pyproject.toml", tmp_path)
    for place in ("core", "simulator", "boards"):
        assert not list((tmp_path / "omnibot_driver" / place).glob(f"{board}*"))
    run = subprocess.run(
        [sys.executable, "-m", "pytest", "-qx", "-m", "not slow", *REMAINS],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    assert " passed" in run.stdout
