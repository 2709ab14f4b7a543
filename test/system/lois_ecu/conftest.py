# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Fixtures: a driver, and a simulated LOIS ECU that follows the manual or the public firmware."""

from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

import pytest
from driver_process import Driver
from lois_ecu_rig import Ecu, ecu_of

from omnibot_driver.simulator.lois_ecu import QUIRKS

Start = Callable[..., Any]


@pytest.fixture(params=QUIRKS)
def ecu(request: pytest.FixtureRequest, stack: ExitStack) -> Ecu:
    return ecu_of(request.param, stack)


@pytest.fixture
def driver(ecu: Ecu, start_driver: Start) -> Driver:
    started: Driver = start_driver(ecu.path, board="lois_ecu")
    return started
