# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Test that the time in which a slow line sends bytes does not count as a pause."""

import pytest

from omnibot_driver.core.omnibot.gaps import InterFrameGaps


@pytest.mark.parametrize(
    ("baudrate", "pause_s", "idle"),
    [
        (115200, 0.0063, True),
        (115200, 0.0060, False),
        (38400, 0.0063, False),
        (38400, 0.0101, False),
        (38400, 0.0103, True),
    ],
)
def test_bytes_of_a_slow_line_take_longer(baudrate: int, pause_s: float, idle: bool) -> None:
    """The time that the line needs for the bytes of a read does not count as a pause.

    The line counts as idle if the pause is more than 4 ms longer than this time.
    """
    pauses = InterFrameGaps(10 / baudrate)
    pauses.read(pause_s, 24, 5, now=1.0)
    assert bool(pauses.gaps) is idle
