# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Test of a busy computer on a good line. ``make faults`` runs it for half a minute."""

from pathlib import Path

from busy_computer import PiecesRig, is_busy
from omnibot_board import BOARD


def test_a_busy_computer_loses_no_message(tmp_path: Path, lenience: dict[str, float]) -> None:
    """A busy computer loses no message: the driver publishes all that the board sends, in order.

    Four busy loops run, and the line delivers four bytes at a time.
    """
    with PiecesRig(tmp_path, BOARD, **lenience) as rig:
        is_busy(rig, ticks=200)
        assert not rig.findings.take(), rig.driver.output
