# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the files that ``colcon build`` and ``pip install`` create, and of the programs in them.

The programs are started as ``ros2 run`` starts them.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import Timer

import pytest
from ament_index_python.packages import get_package_prefix

ROOT = Path(__file__).parents[2]
PACKAGE = "omnibot_driver"
DEADLINE_S = 60.0
FOR_USERS = (
    *("package.xml", "LICENSE", "*.md", "CHANGELOG.rst", "docs/**/*.md", "docs/pictures/*"),
    *("config/*", "launch/*", "rviz/*", "systemd/*", "udev/*", "urdf/*"),
)
SHARED_FILES = [
    f"ament_index/resource_index/packages/{PACKAGE}",
    *(f"{PACKAGE}/{path.relative_to(ROOT)}" for name in FOR_USERS for path in ROOT.glob(name)),
]


def run(command: Sequence[str | Path], cwd: Path) -> str:
    """Run the command to its end, and return its output. The command must succeed."""
    done = subprocess.run(
        command, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
    )
    assert done.returncode == 0, done.stdout
    return done.stdout


@contextmanager
def running(command: Sequence[str | Path], cwd: Path) -> Iterator[subprocess.Popen[str]]:
    """Run the command during the ``with`` block, and yield its process.

    The process is killed at the end of the block, and after 60 s at the latest.
    """
    process = subprocess.Popen(
        command, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    watchdog = Timer(DEADLINE_S, process.kill)
    watchdog.start()
    with process:
        try:
            yield process
        finally:
            watchdog.cancel()
            process.kill()


def first_line_with(text: str, process: subprocess.Popen[str]) -> str:
    """Return the process's next line of output that contains the text."""
    assert process.stdout is not None
    seen = []
    for line in process.stdout:
        if text in line:
            return line
        seen.append(line)
    pytest.fail(f"{process.args} ended without a line with {text!r}:\n{''.join(seen)}")


MADE_HERE = (".*", "__pycache__", "*.egg-info", "build", "install", "log")
"""Names of files and folders that tests and tools create in an unpacked source archive."""


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a copy of the repository's sources, with the files that are not committed yet."""
    copy = tmp_path_factory.mktemp("sources") / PACKAGE
    if not (ROOT / ".git").exists():  # a source archive contains only the sources
        return Path(shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns(*MADE_HERE)))
    listing = run(["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"], ROOT)
    for name in filter(None, listing.split("\0")):
        if (ROOT / name).is_file():  # a tracked file may have been deleted since
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, copy / name)
    return copy


@pytest.fixture(scope="module")
def workspace(sources: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a workspace in which colcon has built the package from an unchanged source tree."""
    workspace = tmp_path_factory.mktemp("workspace")
    before = set(sources.rglob("*"))
    run([sys.executable, "-m", "colcon", "build", "--base-paths", sources], workspace)
    assert set(sources.rglob("*")) == before
    return workspace


def in_workspace(workspace: Path, command: Sequence[str | Path]) -> list[str | Path]:
    """Return the command as it runs in a shell that has sourced the workspace."""
    return ["bash", "-c", '. "$0" && exec "$@"', workspace / "install/setup.bash", *command]


@pytest.fixture(scope="module")
def prefix(workspace: Path) -> Path:
    """Return the package's installation prefix from the ament index."""
    path = run(in_workspace(workspace, ["printenv", "AMENT_PREFIX_PATH"]), workspace).strip()
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("AMENT_PREFIX_PATH", path)
        prefix = Path(get_package_prefix(PACKAGE))
    assert prefix.is_relative_to(workspace)
    return prefix


def test_colcon_installs_what_ros2_looks_for(prefix: Path) -> None:
    """colcon installs the ament index entry, the manifest and all files for users under share."""
    assert len(SHARED_FILES) > len(FOR_USERS)
    for name in SHARED_FILES:
        assert (prefix / "share" / name).is_file(), name


def test_the_installed_documents_link_to_installed_files(prefix: Path) -> None:
    """The installed documents link only to installed files, so they need no repository."""
    pages = [*(prefix / "share" / PACKAGE).glob("**/*.md")]
    assert len(pages) > 10
    for page in pages:
        for target in re.findall(r"\]\(([^)\s#]+)", page.read_text()):
            assert target.startswith("http") or (page.parent / target).is_file(), (page, target)


def test_colcon_installs_the_executables(prefix: Path) -> None:
    """lib/omnibot_driver contains the executables that ``ros2 run`` offers, and no other files."""
    files = list((prefix / "lib" / PACKAGE).iterdir())
    executables = {"calibrate", "demo", "driver", "monitor", "report", "simulator"}
    assert {file.name for file in files} == executables
    assert all(os.access(file, os.X_OK) for file in files)


def test_the_installed_package_is_the_one_that_runs(workspace: Path, prefix: Path) -> None:
    """In a sourced workspace, Python imports the installed copy, which has a type marker."""
    script = f"import {PACKAGE}; print({PACKAGE}.__file__)"
    found = Path(run(in_workspace(workspace, [sys.executable, "-c", script]), workspace).strip())
    assert found.is_relative_to(prefix)
    assert found.with_name("py.typed").is_file()


def test_the_installed_driver_drives_the_installed_simulator(workspace: Path, prefix: Path) -> None:
    """The installed driver runs on the installed simulator. Ctrl-C ends the driver."""
    executables = prefix / "lib" / PACKAGE
    board = workspace / "board"
    simulator = in_workspace(workspace, [executables / "simulator", "--link", board])
    driver = in_workspace(
        workspace,
        [
            executables / "driver",
            *("--ros-args", "--params-file", prefix / "share" / PACKAGE / "config/omnibot.yaml"),
            *("-p", f"port:={board}"),
        ],
    )
    with running(simulator, workspace) as board_process:
        first_line_with("/dev/pts/", board_process)
        with running(driver, workspace) as driver_process:
            first_line_with(f"[{PACKAGE}]", driver_process)
            assert board_process.poll() is None
            driver_process.send_signal(signal.SIGINT)
            output, _ = driver_process.communicate()
            assert driver_process.returncode == 0, output


def test_colcon_test_runs_the_tests(sources: Path, workspace: Path) -> None:
    """``colcon test`` runs the tests, because the package's setup.py names pytest.

    If setup.py did not name pytest, colcon would run no tests.
    """
    one = ["test/core/omnibot/test_modes.py", " --maxfail=1"]
    colcon = [sys.executable, "-m", "colcon"]
    run([*colcon, "test", "--base-paths", sources, "--pytest-args", *one], workspace)
    summary = run([*colcon, "test-result", "--all"], workspace)
    found = re.search(r"Summary: (\d+) tests, 0 errors, 0 failures", summary)
    assert found, summary
    assert int(found[1]) > 1


def test_pip_installs_the_same_files(sources: Path, tmp_path: Path) -> None:
    """A plain ``pip install`` installs the same files as colcon does."""
    copy = tmp_path / "sources"  # pip builds inside the source tree
    shutil.copytree(sources, copy)
    pip = [sys.executable, "-m", "pip", "install", "--no-deps", "--no-build-isolation"]
    run([*pip, "--no-compile", "--prefix", tmp_path / "prefix", copy], tmp_path)
    for name in SHARED_FILES:
        assert (tmp_path / "prefix/share" / name).is_file(), name
    for name in ("driver", "monitor", "simulator"):
        assert os.access(tmp_path / "prefix/bin" / name, os.X_OK)
