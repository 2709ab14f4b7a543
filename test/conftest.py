# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Fixtures that all tests share, and the settings of ROS and Hypothesis.

ROS traffic stays within this test run. ``pytest --hypothesis-profile exploring`` tries other
examples than usual.
"""

import contextlib
import os
import socket
import threading
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, settings
from interpreted import INTERPRETED
from terminal import Terminal

if TYPE_CHECKING:
    from guarded_line import Line

    from omnibot_driver.simulator.omnibot import PtyBoard


def free_domain() -> tuple[int, socket.socket]:
    """Return a ROS domain from 1 to 99 that no other test process uses, and its socket.

    The open socket marks the domain as used. Raises OSError if all these domains are in use.
    """
    # ROS uses 0 by default; some tests need 100 and 101 without any driver; numbers above 101 are
    # not safe on every platform.
    for number in range(1, 100):
        mark = socket.socket(socket.AF_UNIX)
        with contextlib.suppress(OSError):
            mark.bind(f"\0omnibot_driver.test.ros_domain.{number}")
            return number, mark
        mark.close()
    raise OSError("all ROS domains from 1 to 99 are in use by other tests: end these tests first")


DOMAIN, DOMAIN_MARK = free_domain()
os.environ["ROS_DOMAIN_ID"] = str(DOMAIN)
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

ENDS_WITHIN_S = 60.0
"""How long a thread of a closed link may still run, in s. The driver's own limit is shorter."""

settings.register_profile("exploring", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("same", settings.get_profile("exploring"), derandomize=True)
settings.load_profile("same")


WAITING = ("faults", "system", "tools")
"""Folders with tests that wait in real time. These tests are slow."""


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Order the test files for parallel workers.

    The longest files come first. Then files that wait in real time and files that compute
    alternate, so that the drivers in waiting tests get enough processor time.
    """
    if not hasattr(config, "workerinput"):
        return
    home = Path(__file__).parent
    first = (home / "test_board_removed.py", home / "integrity" / "test_integrity.py")
    places: dict[Path, tuple[int, bool]] = {}
    seen = Counter[bool]()
    for path in dict.fromkeys(item.path for item in items):
        computes = path.relative_to(home).parts[0] not in WAITING
        seen[computes] += 1
        places[path] = (-1 if path in first else seen[computes], computes)
    items.sort(key=lambda item: places[item.path])


def pytest_report_header() -> str:
    """Say whether the compiled or the interpreted core is tested."""
    return f"core: {'interpreted' if INTERPRETED else 'compiled'}"


@pytest.fixture
def nothing_left_behind() -> Iterator[None]:
    """Check that the links, ports and boards of a test leave no thread and no descriptor behind."""
    threads, descriptors = driver_threads(), os.listdir("/proc/self/fd")
    yield
    for thread in threading.enumerate():
        if thread.name in driver_threads() and thread.name not in threads:
            thread.join(ENDS_WITHIN_S)
    assert driver_threads() == threads
    assert len(os.listdir("/proc/self/fd")) == len(descriptors)


def driver_threads() -> list[str]:
    """Return the names of the threads of links, recordings and simulated boards.

    The threads of the test runner itself are left out.
    """
    names = (thread.name for thread in threading.enumerate())
    return sorted(name for name in names if name.startswith(("omnibot-", "simulated board")))


@pytest.fixture
def terminal() -> Iterator[Terminal]:
    """Yield a terminal. Close it before ``nothing_left_behind`` looks for open descriptors."""
    terminal = Terminal()
    yield terminal
    terminal.close()


@pytest.fixture
def no_guard_is_killed_while_it_speaks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the driver wait longer for its guard.

    A busy computer may delay the guard's start and its repetition of the stop bytes.
    """
    monkeypatch.setattr("omnibot_driver.keeper.SPEAKS_WITHIN_S", 60.0)


@pytest.fixture
def line() -> Iterator["Line"]:
    """Yield a guarded line. At the end, check that no process and no descriptor is left behind."""
    from guarded_line import Line

    descriptors = len(os.listdir("/proc/self/fd"))
    line = Line()
    yield line
    line.close()
    assert len(os.listdir("/proc/self/fd")) == descriptors
    assert line.children() == [], "a process is left behind, or a zombie"


@pytest.fixture
def board() -> Iterator["PtyBoard"]:
    """Yield a running board on a pseudo-terminal."""
    from omnibot_driver.simulator.omnibot import BoardSettings, PtyBoard, SimulatedBoard

    with PtyBoard(SimulatedBoard(BoardSettings(running=True))) as board:
        yield board
