# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A board with its lines, in board time. The lines carry packets, and can be faulty.

Serial bytes to the board never have faults. This module must not know what packets mean.
"""

from collections.abc import Sequence
from typing import Generic, TypeVar

from omnibot_driver.simulator.common.board import Channel, Packet, SimulatedBoard
from omnibot_driver.simulator.common.faults import FaultyLine
from omnibot_driver.simulator.common.network import FaultyNetwork

B = TypeVar("B", bound=SimulatedBoard)

Line = FaultyLine | FaultyNetwork
"""A simulated line: ``FaultyLine`` carries serial bytes, and ``FaultyNetwork`` carries datagrams.
"""


def good_line(channel: Channel) -> Line:
    """Return a line without faults."""
    return FaultyNetwork() if channel.datagrams else FaultyLine()


class WiredBoard(Generic[B]):
    """A board and one line for each of its channels, in order; by default, lines without faults.

    Raises ValueError if the lines do not match the channels.
    """

    def __init__(self, board: B, lines: Sequence[Line] = ()) -> None:
        self.board = board
        self.lines = tuple(lines) or tuple(good_line(channel) for channel in board.channels)
        matching = [isinstance(line, FaultyNetwork) for line in self.lines]
        if matching != [channel.datagrams for channel in board.channels]:
            raise ValueError(
                f"the {len(self.lines)} lines do not match the board's channels {board.channels}"
            )
        self._networks = [
            (channel, line)
            for channel, line in enumerate(self.lines)
            if isinstance(line, FaultyNetwork)
        ]
        self._ticks = 0
        self._board_began_s = 0.0

    def receive(self, data: bytes, now: float, channel: int = 0) -> None:
        """Send data to the board; ``now`` is in s, by any monotonic clock.

        The line's faults affect datagrams. Serial bytes reach the board at once, without faults.
        """
        line, time_s = self.lines[channel], self._time_s
        if isinstance(line, FaultyLine):
            self.board.receive(data, now, channel)
            return
        self._board_began_s = now - time_s
        line.to_board.send(data, time_s)
        self._hand_over(channel, line)

    def advance(self) -> list[Packet]:
        """Advance by one tick; return the packets from the board that arrive in this tick."""
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
