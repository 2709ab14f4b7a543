# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Test that an idle line is detected, and that the time in which bytes arrive is not a pause."""

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
    """24 bytes take 2.08 ms at 115200 baud and 6.25 ms at 38400 baud.

    If the line was idle, the read is at least 4 ms later.
    """
    pauses = InterFrameGaps(10 / baudrate)
    pauses.read(pause_s, 24, 5, now=1.0)
    assert bool(pauses.gaps) is idle
