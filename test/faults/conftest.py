# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Fixtures of the campaign's tests."""

from collections.abc import Iterator

import pytest
import rclpy


@pytest.fixture(scope="module", autouse=True)
def _ros() -> Iterator[None]:
    ours = not rclpy.ok()
    if ours:
        rclpy.init()
    yield
    if ours:
        rclpy.shutdown()


@pytest.fixture(scope="session")
def lenience() -> dict[str, float]:
    """Return time limits of the rig, in s, that the tests keep even on a busy machine.

    The limits are the grace time for a stop and the time for the driver's end. ``make faults`` uses
    0.1 s and 2 s.
    """
    return {"grace_s": 30.0, "ends_within_s": 60.0}
