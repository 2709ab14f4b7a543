# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the integral of a constant twist, and of its inverse."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import small_moves
from synthetic_board import arc, close, xyyaw

from omnibot_driver.core.geometry.se2 import Pose, log_of, roll


@pytest.mark.slow
@given(small_moves)
def test_roll_is_the_integral_of_a_constant_twist(tangent: Pose) -> None:
    """``roll`` converts a constant twist to a displacement, as the textbook's integral does."""
    chord = roll(tangent)
    expected = arc(tangent.x_m, tangent.y_m, tangent.yaw_rad)
    assert (chord.x_m, chord.y_m) == pytest.approx(expected, abs=1e-9)
    assert chord.yaw_rad == tangent.yaw_rad


@given(st.builds(Pose, st.floats(-10, 10), st.floats(-10, 10), st.floats(-3.2767, 3.2767)))
def test_unroll_and_roll_are_inverse(displacement: Pose) -> None:
    """A displacement is converted to a constant twist and back. Nothing is lost.

    This holds for every turn that fits in a delta frame.
    """
    assert xyyaw(roll(log_of(displacement))) == close(xyyaw(displacement))
    assert xyyaw(log_of(roll(displacement))) == close(xyyaw(displacement))


@pytest.mark.parametrize("turn", [0.0, 5e-324, 1e-300, -1e-300, 1e-9, -1e-9])
def test_a_turn_of_almost_nothing_is_not_trouble(turn: float) -> None:
    """A turn near zero causes neither a division by zero nor a loss of digits."""
    assert xyyaw(roll(Pose(0.1, 0.2, turn))) == close((0.1, 0.2, turn), 1e-9)
    assert xyyaw(log_of(Pose(0.1, 0.2, turn))) == close((0.1, 0.2, turn), 1e-9)
