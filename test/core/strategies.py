# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Hypothesis strategies for all boards: twists, wheel rates, moves, and pieces of a byte stream."""

from collections.abc import Sequence

from hypothesis import strategies as st

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.readings import DisplacementReading

finite = st.floats(allow_nan=False, allow_infinity=False, min_value=-1e308, max_value=1e308)
twists = st.builds(BodyTwist, *[st.floats(-10, 10)] * 3)
any_twists = st.builds(BodyTwist, finite, finite, finite)
wheel_rates = st.tuples(*[st.floats(-200, 200)] * 3)
axis_signs = st.tuples(*[st.sampled_from([1, -1])] * 3)

headings = st.floats(-10, 10)
small_moves = st.builds(Pose, st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(-1.5, 1.5))
"""Displacements in one period of 40 ms, in body axes.

The largest of them are faster than any real robot.
"""


def displacements(frame: str) -> st.SearchStrategy[DisplacementReading]:
    return st.builds(
        DisplacementReading,
        dx_m=st.floats(-0.1, 0.1),
        dy_m=st.floats(-0.1, 0.1),
        dyaw_rad=st.floats(-1.5, 1.5),
        frame=st.just(frame),
        duration_s=st.just(0.04),
        lost=st.just(0),
    )


def chunkings(data: bytes) -> st.SearchStrategy[list[bytes]]:
    """Return a strategy for lists of consecutive pieces of ``data``. Some pieces may be empty."""
    cuts = st.lists(st.integers(0, len(data)), max_size=30).map(sorted)
    return cuts.map(lambda at: cut(data, at))


def cut(data: bytes, at: Sequence[int]) -> list[bytes]:
    """Return the pieces of ``data`` between cuts at ascending positions."""
    return [data[start:end] for start, end in zip([0, *at], [*at, len(data)], strict=True)]
