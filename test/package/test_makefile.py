# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the Makefile: its list of targets, and its behaviour if something is missing."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def make(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run make in the repository, without the variables of an outer make, and return its result."""
    environment = {name: value for name, value in os.environ.items() if "MAKE" not in name}
    return subprocess.run(
        ["make", "--no-print-directory", *arguments],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture
def no_python(tmp_path: Path) -> str:
    """Return the path of an interpreter that always fails.

    It represents a Python version for which PyPI has no binary packages.
    """
    interpreter = tmp_path / "python"
    interpreter.write_text("#!/bin/sh\nexit 1\n")
    interpreter.chmod(0o755)
    return str(interpreter)


@pytest.mark.parametrize("target", ["demo", "test"])
def test_without_wheels_one_sentence_points_to_jazzy(
    target: str, no_python: str, tmp_path: Path
) -> None:
    """make fails, because PyPI has no binary packages for this Python.

    The error message names the installation guide of Jazzy. No virtual environment is created.
    """
    done = make(target, f"PYTHON={no_python}", f"VENV={tmp_path / 'venv'}")
    sentence, verdict = done.stderr.splitlines()
    assert done.returncode != 0
    assert "https://docs.ros.org/en/jazzy/Installation.html" in sentence
    assert verdict.startswith("make: ***")
    assert not done.stdout
    assert not (tmp_path / "venv").exists()


def test_a_linked_venv_is_not_emptied(tmp_path: Path) -> None:
    """The folder ``.venv`` is a link to another environment. make must not clear it."""
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs/kept").touch()
    (tmp_path / "venv").symlink_to(tmp_path / "theirs")
    done = make("demo", f"VENV={tmp_path / 'venv'}", f"PYTHON={sys.executable}")
    assert done.returncode != 0
    assert (tmp_path / "theirs/kept").exists()


@pytest.fixture
def venv_with_errors(tmp_path: Path) -> Path:
    """Return a complete ``.venv`` whose Python only records its arguments.

    If the arguments request a check, the exit code is 1, as if the check had found errors.
    """
    venv = tmp_path / "venv"
    (venv / "bin").mkdir(parents=True)
    python = venv / "bin/python"
    python.write_text(
        f'#!/bin/sh\necho "$@" >> {tmp_path}/calls\ncase "$*" in *--check | *check) exit 1; esac\n'
    )
    python.chmod(0o755)
    for stamp in (".runtime", ".test"):
        (venv / stamp).touch()
    return venv


def test_files_are_formatted_although_errors_remain(venv_with_errors: Path) -> None:
    """``make format`` formats the files even if they have errors that it cannot correct.

    It shows the remaining errors last.
    """
    done = make("format", f"VENV={venv_with_errors}")
    calls = (venv_with_errors.parent / "calls").read_text().splitlines()
    assert calls == ["-m ruff check --fix-only", "-m ruff format", "-m ruff check"]
    assert done.returncode != 0


def test_a_file_without_format_is_told_with_the_remedy(venv_with_errors: Path) -> None:
    """``make lint`` finds a file with a wrong format. One line names the target to run."""
    done = make("lint", f"VENV={venv_with_errors}")
    assert "Please run make format." in done.stderr
    assert done.returncode != 0


def test_make_alone_lists_every_target() -> None:
    """The default target describes each of the other targets in one line."""
    listed = {line.split()[1] for line in make().stdout.splitlines()}
    targets = {"demo", "check", "test", "docs", "pictures", "integrity", "bench", "faults", "soak"}
    assert listed == {"help", *targets, "compiled", "lint", "format", "clean"}
