# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the options of a simulated OmniBot in a URL."""

import pytest

from omnibot_driver.simulator import omnibot
from omnibot_driver.simulator.common.options import OptionError, from_url
from omnibot_driver.simulator.common.wired import Line
from omnibot_driver.simulator.omnibot import (
    BoardSettings,
    FaultyLine,
    LineFaults,
    ReceiverKind,
    SimulatedBoard,
)

SENT = bytes(range(256)) * 4


def board_from_url(url: str) -> tuple[SimulatedBoard, Line]:
    """Return the board that the URL describes, and its only line."""
    board, (line,) = from_url(url, omnibot)
    return board, line


def test_every_option_reaches_the_board_and_its_line() -> None:
    """A URL has all options of a simulated board. Each option reaches the board or its line.

    The seed reaches both.
    """
    board, line = board_from_url(
        "sim://?seed=7&imu_only&frame=body&delta_period=0.1&control=position&latching_estop&running"
        "&receiver=idle_gap&letters=anywhere&wakes_while_booting&ignore_estop"
        "&lose=0.1&burst=0.002&flip=0.2"
    )
    assert board.settings == BoardSettings(
        seed=7,
        imu_only=True,
        frame="body",
        delta_period_s=0.1,
        control="position",
        receiver=ReceiverKind(framing="idle_gap", letters="anywhere", wakes_while_booting=True),
        obeys_estop=False,
        estop_latches=True,
        running=True,
    )
    expected = FaultyLine(LineFaults(lose=0.1, burst=0.002, flip=0.2), 7)
    assert line.carry(SENT) == expected.carry(SENT)


@pytest.mark.parametrize("period", ["0", "-0.04", "0.045", "nan", "inf", "fast", "11"])
def test_deltas_are_sent_every_so_many_ticks(period: str) -> None:
    """The simulator rejects a delta period that is not a whole number of ticks, 1 tick to 10 s."""
    with pytest.raises(OptionError, match="not a period of the board"):
        board_from_url(f"sim://?delta_period={period}")


def test_without_options_all_is_as_usual() -> None:
    """Without options, the board has the default settings, and its line has no faults."""
    board, line = board_from_url("sim://")
    assert board.settings == BoardSettings()
    assert line.carry(SENT) == SENT
