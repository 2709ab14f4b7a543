# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of boards with several lines or with datagrams, in simulated time."""

import pytest
from toy_lines import DRIVE, FRONT, ToyLines
from toy_udp import ToyServer

from omnibot_driver.simulator.common.faults import FaultyLine, LineFaults
from omnibot_driver.simulator.common.network import FaultyNetwork, NetworkFaults
from omnibot_driver.simulator.common.wired import WiredBoard


def test_each_channel_has_its_own_bytes_in_any_pieces() -> None:
    """The board obeys a command in two pieces with data of another channel in between."""
    wired = WiredBoard(ToyLines())
    wired.receive(b"go 0.", 0.0, DRIVE)
    wired.receive(b"angle 30\n", 0.0, FRONT)
    wired.receive(b"5 0\n", 0.0, DRIVE)
    packets = [packet for _ in range(20) for packet in wired.advance()]
    assert packets == [(FRONT, b"fwl 30\n")] * 20 + [(DRIVE, b"odo 0.200 0.000 0.000\n")]


def test_each_channel_has_its_own_faults() -> None:
    """Each channel has the faults of its own line.

    The line of the channel FRONT loses all bytes. The line of the channel DRIVE loses none.
    """
    cut = FaultyLine(LineFaults(lose=1.0))
    wired = WiredBoard(ToyLines(), [FaultyLine(), cut])
    packets = [packet for _ in range(20) for packet in wired.advance()]
    assert packets == [(DRIVE, b"odo 0.000 0.000 0.000\n")]
    assert cut.counts == {"lost": 20 * len(b"fwl 0\n"), "flipped": 0}


def test_a_request_is_answered_when_its_move_is_done() -> None:
    """The toy board executes ``move``, and replies to this command at the end of the move.

    During the move, another ``move`` fails, and the query ``odo`` is answered at once.
    """
    wired = WiredBoard(ToyServer())
    wired.receive(b"move 0.02", 5.0)
    wired.receive(b"odo", 5.0)
    wired.receive(b"move 1", 5.0)
    assert [wired.advance() for _ in range(4)] == [
        [(0, b"ok 0.000"), (0, b"fail")],
        [],
        [],
        [(0, b"ok 0.020")],
    ]


def test_datagrams_reach_the_board_once_late_or_never_in_board_time() -> None:
    """The delay of a datagram is measured in the board's simulated time, not in real time."""
    network = FaultyNetwork(NetworkFaults(delay_s=10.0, duplicate=0.5, lose=0.2))
    board = ToyServer()
    wired = WiredBoard(board, [network])
    for number in range(100):
        wired.receive(b"odo %d" % number, 7.0)
    assert len(board.requests) < 10
    answers = [packet for _ in range(2000) for packet in wired.advance()]
    assert len(board.requests) == 100 - network.to_board.lost + network.to_board.duplicated
    assert board.requests != sorted(board.requests, key=lambda data: int(data.split()[1]))
    lost, doubled = network.from_board.lost, network.from_board.duplicated
    assert len(answers) == len(board.requests) - lost + doubled


def test_a_late_datagram_arrives_by_the_clock_of_the_others() -> None:
    """The arrival time of a late datagram is a time of the caller's clock, not of the board's."""
    at: list[float] = []

    class Watch(ToyServer):
        def receive(self, data: bytes, now: float, channel: int) -> None:
            at.append(now)

    wired = WiredBoard(Watch(), [FaultyNetwork(NetworkFaults(delay_s=1.0))])
    wired.receive(b"odo", 1000.0)
    for _ in range(101):
        wired.advance()
    assert 1000.0 < at[0] <= 1001.01


def test_lines_that_do_not_match_the_channels_are_a_defect() -> None:
    """A program that gives a board the wrong lines for its channels gets a ValueError.

    It gives one line for two channels, or one line of the wrong kind.
    """
    for lines in ([FaultyLine()], [FaultyLine(), FaultyNetwork()]):
        with pytest.raises(ValueError, match="do not match"):
            WiredBoard(ToyLines(), lines)
