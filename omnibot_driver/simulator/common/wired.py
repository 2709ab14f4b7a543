# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A board at the far end of its lines, in board time: whatever passes meets their faults.

Pure, as the board is. Knows channels and lines. Must not know real time, nor what packets mean.
"""

from collections.abc import Sequence
from typing import Generic, TypeVar

from omnibot_driver.simulator.common.board import Channel, Packet, SimulatedBoard
from omnibot_driver.simulator.common.faults import FaultyLine
from omnibot_driver.simulator.common.network import FaultyNetwork

B = TypeVar("B", bound=SimulatedBoard)

Line = FaultyLine | FaultyNetwork
"""Of a serial channel the first, of one with datagrams the second."""


def good_line(channel: Channel) -> Line:
    """A line without faults."""
    return FaultyNetwork() if channel.datagrams else FaultyLine()


class WiredBoard(Generic[B]):
    """``lines``: one for each of the board's channels, in their order; good ones by default.

    Raises ValueError where they do not match the channels.
    """

    def __init__(self, board: B, lines: Sequence[Line] = ()) -> None:
        self.board = board
        self.lines = tuple(lines) or tuple(good_line(channel) for channel in board.channels)
        matching = [isinstance(line, FaultyNetwork) for line in self.lines]
        if matching != [channel.datagrams for channel in board.channels]:
            raise ValueError(f"{len(self.lines)} lines do not match {board.channels}")
        self._networks = [
            (channel, line)
            for channel, line in enumerate(self.lines)
            if isinstance(line, FaultyNetwork)
        ]
        self._ticks = 0
        self._board_began_s = 0.0

    def receive(self, data: bytes, now: float, channel: int = 0) -> None:
        """Send this to the board; ``now`` is by any steady clock."""
        line, time_s = self.lines[channel], self._time_s
        if isinstance(line, FaultyLine):
            self.board.receive(data, now, channel)
            return
        self._board_began_s = now - time_s
        line.to_board.send(data, time_s)
        self._hand_over(channel, line)

    def advance(self) -> list[Packet]:
        """Let one tick pass; what arrives of what the board sends and has sent."""
        self._ticks += 1
        for channel, network in self._networks:
            self._hand_over(channel, network)
        arrived = []
        for channel, data in self.board.advance():
            line = self.lines[channel]
            if isinstance(line, FaultyNetwork):
                line.from_board.send(data, self._time_s)
            elif data := line.carry(data):
                arrived.append((channel, data))
        for channel, network in self._networks:
            arrived += [(channel, data) for data in network.from_board.arrived(self._time_s)]
        return arrived

    @property
    def _time_s(self) -> float:
        return self._ticks * self.board.tick_s

    def _hand_over(self, channel: int, line: FaultyNetwork) -> None:
        for datagram in line.to_board.arrived(self._time_s):
            self.board.receive(datagram, self._board_began_s + self._time_s, channel)
