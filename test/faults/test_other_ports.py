# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of faults with a board behind a network."""

from collections.abc import Callable, Iterator

import pytest
from omnibot_board import BOARD
from other_rigs import NetworkRig
from stuck import NETWORK

LEFT_OUT = "socket: the server delays the data to the board"
"""Name of a fault that this module omits.

This module tests a similar fault: the server delays the data in both directions. ``make faults``
tests both faults.
"""
CASES = {name: case for name, case in NETWORK.items() if name != LEFT_OUT}


@pytest.fixture(scope="module")
def network(
    _ros: None, tmp_path_factory: pytest.TempPathFactory, lenience: dict[str, float]
) -> Iterator[NetworkRig]:
    with NetworkRig(tmp_path_factory.mktemp("network"), BOARD, **lenience) as rig:
        rig.wait_ticks(100)
        yield rig


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_a_server_that_fails_leaves_a_robot_that_stands_and_obeys_again(
    case: Callable[[NetworkRig], None], network: NetworkRig
) -> None:
    """The network server in front of the board fails during a drive, and the robot comes to rest.

    When the server works again, the robot obeys a new command.
    """
    case(network)
    network.expect_moves_again()
    assert not network.findings.take(), network.driver.output


def test_the_network_publishes_only_what_was_sent(network: NetworkRig) -> None:
    """During the other tests, the driver has published only data that the board has sent."""
    network.judge_stream()
    assert not network.findings.take(), network.driver.output
    assert network.findings.published > 50
