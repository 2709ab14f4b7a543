# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the yaw of a quaternion."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnibot_driver.core.geometry.quaternion import yaw_of


@given(st.floats(-math.pi, math.pi), st.sampled_from([1.0, -1.0]))
def test_a_turn_about_z_is_its_yaw(yaw_rad: float, sign: float) -> None:
    """A quaternion and its negative are the same rotation. Both give the same yaw."""
    found = yaw_of(0.0, 0.0, sign * math.sin(yaw_rad / 2), sign * math.cos(yaw_rad / 2))
    assert math.remainder(found - yaw_rad, math.tau) == pytest.approx(0.0, abs=1e-9)


def test_a_tilt_does_not_matter() -> None:
    """The robot is turned by 90° about z and then tilted about its own x axis. The yaw is 90°."""
    half = math.radians(45.0)
    tilt = math.radians(10.0)
    x, w = math.cos(half) * math.sin(tilt), math.cos(half) * math.cos(tilt)
    y, z = math.sin(half) * math.sin(tilt), math.sin(half) * math.cos(tilt)
    assert yaw_of(x, y, z, w) == pytest.approx(math.pi / 2)
