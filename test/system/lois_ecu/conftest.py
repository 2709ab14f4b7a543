# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Fixtures: a driver, and a simulated LOIS ECU that follows the manual or the public firmware.

The tests of a module share one ECU and driver for each firmware, except those that use ``new``.
"""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import pytest
from driver_process import Driver
from lois_ecu_rig import Ecu, ecu_of
from probe import Probe

from omnibot_driver.simulator.lois_ecu import QUIRKS

Start = Callable[..., Any]


@pytest.fixture(scope="module", params=QUIRKS)
def ecu(_ros: None, request: pytest.FixtureRequest) -> Iterator[Ecu]:
    with ExitStack() as stack:
        yield ecu_of(request.param, stack)


@pytest.fixture(scope="module")
def driver(ecu: Ecu) -> Iterator[Driver]:
    with Driver(port=ecu.path, board="lois_ecu") as driver:
        yield driver


@pytest.fixture
def new(
    firmware: str, stack: ExitStack, start_driver: Start, probe_of: Start
) -> tuple[Ecu, Driver, Probe]:
    """Return a new simulated ECU with the firmware ``firmware``, a new driver and a new probe."""
    ecu = ecu_of(firmware, stack)
    driver: Driver = start_driver(ecu.path, board="lois_ecu")
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    return ecu, driver, probe
