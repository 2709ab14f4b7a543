# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the tools when a Python library is missing."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

import omnibot_driver
from omnibot_driver.tools.needs import ToolError, need

ROOT = Path(omnibot_driver.__file__).parents[1]


def test_a_library_that_is_there_is_imported() -> None:
    """``need`` returns the same module as ``import``."""
    assert need("json") is json


def test_a_library_that_is_missing_is_named_with_what_installs_it() -> None:
    """A submodule of a missing library is imported.

    The message names the library, and explains how to install it.
    """
    with pytest.raises(ToolError) as refusal:
        need("no_such_library.part")
    assert str(refusal.value) == (
        "this tool needs the Python library no_such_library: `pip install --user"
        " --break-system-packages no_such_library` (in a virtual environment `pip install"
        " no_such_library`)"
    )


@pytest.mark.parametrize(
    "words",
    ["tools.calibrate", "tools.calibrate step", "tools.report", "tools.monitor", "demo"],
)
def test_help_needs_no_library(words: str) -> None:
    """Python has only its standard library here, so it has no ROS.

    The help of each tool still works.
    """
    module, *subcommand = words.split()
    done = subprocess.run(
        [sys.executable, "-ES", "-m", f"omnibot_driver.{module}", *subcommand, "--help"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("usage: ")
