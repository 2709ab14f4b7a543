# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A simulated Fejemis on two pseudo-terminals, a driver on it, and a probe of its topics."""

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
