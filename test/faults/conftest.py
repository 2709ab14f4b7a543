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
    """Return time limits that even a busy machine keeps.

    ``make faults`` uses 0.1 s and 2 s instead.
    """
    return {"grace_s": 30.0, "ends_within_s": 60.0}
