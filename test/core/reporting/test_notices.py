# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of messages for users. The messages name only parts that the board has."""

from dataclasses import replace

import pytest
from toys.line_board import LineBoard

from omnibot_driver.core.measurement.outlier_filter import Refused
from omnibot_driver.core.omnibot import OmniBot
from omnibot_driver.core.reporting.notices import Notices, why_silent
from omnibot_driver.core.traits import Traits


@pytest.mark.parametrize("traits", [OmniBot.traits, LineBoard.traits])
@pytest.mark.parametrize("bytes_came", [True, False])
def test_a_baudrate_is_advice_only_where_it_can_be_set(traits: Traits, bytes_came: bool) -> None:
    """Only a board on a serial line has a baud rate. Other boards get no advice on it."""
    text = why_silent(1.5, bytes_came=bytes_came, baudrate=traits.baudrate)
    assert ("`baudrate`" in text) is (bytes_came and traits.baudrate)
    assert " cable" in text
    assert ("baudrate" in traits.to_check) is traits.baudrate
    assert "baudrate" not in replace(traits, baudrate=False).to_check


def test_an_overrun_of_the_port_is_blamed_only_for_frames_lost_at_about_its_time() -> None:
    """Only frames lost at about the time of an overrun of the port are blamed on this overrun."""
    notices, none = Notices(), Refused(0, 0, 0)
    assert notices.counted(0, 0, none, 100.0) == []
    assert notices.counted(0, 1, none, 100.1) == []
    (late,) = notices.counted(2, 1, none, 3700.0)
    assert late == "odometry frames lost on the line: 2; check cable and hub"
    assert notices.counted(3, 2, none, 3705.0) == []
    (soon,) = notices.counted(3, 2, none, 3710.0)
    assert soon.startswith("odometry frames lost in this computer: 1; the serial port overran")
