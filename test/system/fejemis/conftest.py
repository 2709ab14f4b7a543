# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Fixtures: a simulated Fejemis on two pseudo-terminals, and a driver for it.

All tests of a module use the same robot and driver, except those that use ``new``.
"""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from driver_process import Driver
from fejemis_driver import robot_of, started
from probe import Probe
from two_ports import TwoPorts

Start = Callable[..., Any]


@pytest.fixture(scope="module")
def module_stack() -> Iterator[ExitStack]:
    """A stack of context managers. The end of the module closes them in reverse order."""
    with ExitStack() as stack:
        yield stack


@pytest.fixture(scope="module")
def robot(
    _ros: None, module_stack: ExitStack, tmp_path_factory: pytest.TempPathFactory
) -> TwoPorts:
    return robot_of(module_stack, tmp_path_factory.mktemp("ports"))


@pytest.fixture(scope="module")
def driver(robot: TwoPorts, module_stack: ExitStack) -> Driver:
    def start(port: str, **parameters: Any) -> Driver:
        return module_stack.enter_context(Driver(port=port, **parameters))

    return started(robot, start)


@pytest.fixture
def new(
    stack: ExitStack, tmp_path: Path, start_driver: Start, probe_of: Start
) -> tuple[TwoPorts, Driver, Probe]:
    """A robot, its driver and a probe that no other test uses."""
    robot = robot_of(stack, tmp_path)
    driver = started(robot, start_driver)
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    return robot, driver, probe
