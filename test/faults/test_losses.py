# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of each kind of stop on a line that loses bytes. ``make faults`` runs more such tests."""

from pathlib import Path

import pytest
from losses import LIVES, lose, losing_rig
from omnibot_board import BOARD


@pytest.mark.parametrize("number", range(len(LIVES)), ids=[", ".join(life) for life in LIVES])
def test_the_robot_stands_though_bytes_are_lost_on_the_way_to_it(
    number: int, tmp_path: Path, lenience: dict[str, float]
) -> None:
    """The line loses bytes on the way to the board, even while the robot must stop.

    Each kind of stop still works.
    """
    with losing_rig(tmp_path, BOARD, number, **lenience) as rig:
        lose(rig, number)
        for case in LIVES[number].values():
            case(rig)
        assert not rig.findings.take(), rig.driver.output
