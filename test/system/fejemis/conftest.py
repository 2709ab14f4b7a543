# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Fixtures: a simulated Fejemis on two pseudo-terminals, and a driver for it."""

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from driver_process import Driver
from fejemis_driver import robot_of, started
from two_ports import TwoPorts

Start = Callable[..., Any]


@pytest.fixture
def robot(stack: ExitStack, tmp_path: Path) -> TwoPorts:
    return robot_of(stack, tmp_path)


@pytest.fixture
def driver(robot: TwoPorts, start_driver: Start) -> Driver:
    return started(robot, start_driver)
