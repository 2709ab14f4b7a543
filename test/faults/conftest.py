# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Fixtures of the tests of the fault campaign."""

from collections.abc import Iterator
from contextlib import nullcontext

import pytest
import rclpy
from probe import ros


@pytest.fixture(scope="module", autouse=True)
def _ros() -> Iterator[None]:
    with nullcontext() if rclpy.ok() else ros():
        yield


@pytest.fixture(scope="session")
def lenience() -> dict[str, float]:
    """Return values of ``grace_s``, ``ends_within_s`` and ``rest_s`` (s) for a busy computer.

    ``rest_s`` is long enough to find a driver that does not stop the robot: such a driver sends
    six commands in this time. ``make faults`` uses the defaults of ``Rig`` instead.
    """
    return {"grace_s": 30.0, "ends_within_s": 60.0, "rest_s": 0.3}
