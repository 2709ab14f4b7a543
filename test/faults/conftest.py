# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Fixtures of the campaign's tests."""

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
    """Return times of the rig, in s, that are long enough for a busy computer.

    These are the grace time for a stop, the time for the driver's end, and the time of rest after
    a stop. ``rest_s`` is the time of ten commands, so a commander that continues is noticed.
    ``make faults`` uses 0.1 s, 2 s and 1 s.
    """
    return {"grace_s": 30.0, "ends_within_s": 60.0, "rest_s": 0.5}
