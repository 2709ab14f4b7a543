# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the programs that search and measure: their command lines."""

import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
PROGRAMS = ["honesty", "mart_campaign", "mart_goals", "mart_model_search", "real_search"]


@pytest.mark.parametrize("name", PROGRAMS)
@pytest.mark.parametrize(("argument", "code"), [("--help", 0), ("nonsense", 2)])
def test_help_and_a_wrong_argument_show_the_usage(name: str, argument: str, code: int) -> None:
    """A user starts one of the tests' programs with ``--help`` or with a wrong argument.

    The program shows its usage, without a traceback.
    """
    program = str(HERE / f"{name}.py")
    paths = ":".join(str(path) for path in (HERE.parents[2], HERE.parents[1], HERE.parent))
    done = subprocess.run(
        [sys.executable, program, argument],
        capture_output=True,
        text=True,
        env={"PYTHONPATH": paths},
        timeout=60.0,
        check=False,
    )
    assert (done.returncode, "Traceback" in done.stderr) == (code, False)
    assert f"usage: {name}.py" in done.stdout + done.stderr
