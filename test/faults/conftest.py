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
    """Return three durations for ``Rig``, in s. They are suitable for a busy computer.

    A commander sends six commands in ``rest_s``, so the rig still notices if a commander does not
    stop. ``make faults`` uses other durations: 0.1 s, 2 s and 1 s, in the same order.
    """
    return {"grace_s": 30.0, "ends_within_s": 60.0, "rest_s": 0.3}
