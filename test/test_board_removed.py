# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Each board can be removed: without its own files, the other boards still work."""

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Final

import pytest

from omnibot_driver import boards

HOME: Final = Path(__file__).parents[1]
MOVES: Final = (
    "test/core/test_every_board.py::test_a_command_moves_the_robot_and_odometry_tells_how_far"
)
DRIVER: Final = (
    "test/system/test_driver_toys.py"
    "::test_a_toy_drives_and_is_heard_and_obeys_the_estop[line_board]"
)
SIMULATED: Final = "test/transports/test_simulated.py"
IMPORT_AND_TEST: Final = """
import importlib, pkgutil, sys
import pytest
from omnibot_driver import boards, core, node, simulator, transports
for package in (boards, core, simulator, transports):
    for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
sys.exit(pytest.main(sys.argv[1:]))
"""


@pytest.mark.parametrize("board", boards.PROFILES)
def test_without_the_files_of_one_board_the_rest_still_works(board: str, tmp_path: Path) -> None:
    """Without the files of one board, all other modules can be imported, and selected tests pass.

    Without the default board, a test of the complete driver passes, too.
    """
    default, *others = boards.PROFILES
    remaining = others[0] if board == default else default
    tests = [f"{MOVES}[{remaining}]", SIMULATED, *([DRIVER] if board == default else [])]
    ignored = shutil.ignore_patterns(board, f"{board}.py", f"{board}_*.py")
    # Copying __pycache__ saves time. Python ignores a file in it if the source is missing.
    for folder in ("omnibot_driver", "test"):
        shutil.copytree(HOME / folder, tmp_path / folder, ignore=ignored)
    shutil.copy(HOME / "pyproject.toml", tmp_path)
    for place in ("core", "simulator", "boards"):
        assert not list((tmp_path / "omnibot_driver" / place).glob(f"{board}*"))
    run = subprocess.run(
        [sys.executable, "-c", IMPORT_AND_TEST, "-qx", "-p", "no:cacheprovider", *tests],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    assert " passed" in run.stdout
