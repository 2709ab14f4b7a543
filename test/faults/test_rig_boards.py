# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that the campaign's settings of each board name only faults and services that exist."""

import pytest
from campaign import BOARDS, pieces
from cases import survivable
from endings import ENDINGS
from rig_board import load
from walk import CALLS, steps_of


@pytest.mark.parametrize("board", BOARDS)
def test_every_board_has_faults_and_leaves_out_only_what_exists(board: str) -> None:
    """Every board has at least one fault that the campaign injects.

    The board's ``without`` names only faults and parts of the campaign that exist.
    """
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


@pytest.mark.parametrize("board", BOARDS)
def test_a_random_walk_calls_only_services_that_the_board_has(board: str) -> None:
    """The campaign's random walk injects faults, and calls only services that the board has."""
    kind = load(board)
    steps = steps_of(kind)
    assert {CALLS[name] for name in steps if name in CALLS} == kind.services & {*CALLS.values()}
    assert steps.keys() - CALLS.keys()
