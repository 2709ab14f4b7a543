# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What may be chosen about a simulated board, in words."""

from omnibot_driver.simulator import BoardSettings, FaultyLine, LineFaults
from omnibot_driver.simulator.options import board_from_url

SENT = bytes(range(256)) * 4


def test_every_option_reaches_the_board_and_its_line() -> None:
    """Each by its name, the seed twice."""
    board, line = board_from_url(
        "sim://?seed=7&imu_only&frame=body&control=position&latching_estop&running"
        "&lose=0.1&burst=0.002&flip=0.2"
    )
    assert board.settings == BoardSettings(
        seed=7,
        imu_only=True,
        frame="body",
        control="position",
        estop_latches=True,
        running=True,
    )
    expected = FaultyLine(LineFaults(lose=0.1, burst=0.002, flip=0.2), 7)
    assert line.carry(SENT) == expected.carry(SENT)


def test_without_options_all_is_as_usual() -> None:
    """And the line is good."""
    board, line = board_from_url("sim://")
    assert board.settings == BoardSettings()
    assert line.carry(SENT) == SENT
