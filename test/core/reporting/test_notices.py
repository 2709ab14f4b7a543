# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Messages for users: they name only parts that the board has."""

from dataclasses import replace

import pytest
from toys.line_board import LineBoard

from omnibot_driver.core.omnibot import OmniBot
from omnibot_driver.core.reporting.notices import why_silent
from omnibot_driver.core.traits import Traits


@pytest.mark.parametrize("traits", [OmniBot.traits, LineBoard.traits])
@pytest.mark.parametrize("bytes_came", [True, False])
def test_a_baudrate_is_advice_only_where_it_can_be_set(traits: Traits, bytes_came: bool) -> None:
    """Datagrams and USB have no baud rate."""
    text = why_silent(1.5, bytes_came=bytes_came, baudrate=traits.baudrate)
    assert ("`baudrate`" in text) is (bytes_came and traits.baudrate)
    assert " cable" in text
    assert ("baudrate" in traits.to_check) is traits.baudrate
    assert "baudrate" not in replace(traits, baudrate=False).to_check
