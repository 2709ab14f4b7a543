# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Test that the campaign's settings of each board name only faults that exist."""

import pytest
from campaign import BOARDS, pieces
from cases import survivable
from endings import ENDINGS
from rig_board import load


@pytest.mark.parametrize("board", BOARDS)
def test_every_board_has_faults_and_leaves_out_only_what_exists(board: str) -> None:
    """Every board has faults to inject. The faults that it leaves out (``without``) exist."""
    kind = load(board)
    own = (kind.cases or survivable)(0)
    assert own.keys() - kind.without
    assert all(map(callable, own.values()))
    assert kind.without <= {
        *survivable(0),
        *own,
        *ENDINGS,
        *(name for name, _ in pieces()),
        "busy_computer",
    }
