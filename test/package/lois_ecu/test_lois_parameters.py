# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of conditions between several parameters of the LOIS ECU."""

import pytest

from omnibot_driver.boards.lois_ecu import PARAMETERS, settings
from omnibot_driver.boards.lois_ecu_parameters import PERIODS, SETTINGS
from omnibot_driver.core.errors import ParameterError


def test_commands_are_slow_in_a_terminal_mode() -> None:
    """In a terminal mode, a command rate above 25 Hz is rejected.

    The public firmware then forwards each command to a slow sensor, so a stop would arrive late or
    never.
    """
    with pytest.raises(ParameterError, match="at most 25 Hz"):
        PARAMETERS.check_all({"terminal_mode": "compass", "command_rate": 30.0})
    PARAMETERS.check_all({"command_rate": 30.0})
    PARAMETERS.check_all({"terminal_mode": "compass"})


def test_the_description_of_max_wheel_speed_names_every_topic_that_it_limits() -> None:
    """The largest wheel rate limits ``wheel_cmd`` and ``duty_cmd``. Its description names both."""
    description = PARAMETERS.by_name["max_wheel_speed"].description
    assert "wheel_cmd" in description
    assert "duty_cmd" in description


def test_what_the_board_keeps_is_unset_by_default() -> None:
    """Settings and periods that the board keeps are unset by default, so nothing is written.

    Regression: the driver wrote periods of 0.2 s by default.
    """
    values = PARAMETERS.check_all({})
    assert {name: values[name] for name in (*PERIODS, *SETTINGS)} == dict.fromkeys(
        (*PERIODS, *SETTINGS)
    )
    assert (settings(values).periods_ms, settings(values).written) == ({}, {})


@pytest.mark.parametrize("period_s", [0.0, 0.01, 0.6])
def test_ticks_are_neither_turned_off_nor_rare(period_s: float) -> None:
    """The driver rejects a ``ticks_period`` that is 0, too short or too long.

    Without the messages that contain encoder ticks, nothing confirms a stop. To keep the board's
    own period, the user omits the parameter.
    """
    with pytest.raises(ParameterError, match=r"ticks_period' must be 0\.05 to 0\.5 s"):
        PARAMETERS.check_all({"ticks_period": period_s})
