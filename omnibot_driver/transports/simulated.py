# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""``sim://``: a simulated board inside this process, as a transport.

Example with options: ``sim://?seed=1&lose=0.001``. This module must not know the meaning of the
board's bytes.
"""

import threading
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from queue import Empty, SimpleQueue
from typing import Final

from omnibot_driver.core.errors import LinkError, ParameterError
from omnibot_driver.simulator.common import options
from omnibot_driver.simulator.common.board import Packet, SimulatedBoard
from omnibot_driver.simulator.common.running import UNREAD_LIMIT, RunningBoard
from omnibot_driver.simulator.common.wired import Line
from omnibot_driver.transports import NONE_MISSING, READ_TIMEOUT_S

UNREAD_DATAGRAMS: Final = 256
"""Largest number of unread datagrams. A Linux socket holds about as many small datagrams."""


class SimulatedTransport:
    """A simulated board in real time, whose channels are in memory.

    ``simulator``: full name of the board's package.

    Raises ParameterError for a wrong URL, RuntimeError if the board's thread has died.
    """

    missing = NONE_MISSING
    overruns: int | None = None
    """None, because a channel in memory does not count lost bytes."""
    ends_with_us: bool = True
    """Always True: the simulated board is in this process and ends with it."""
    descriptors: tuple[int, ...] | None = None
    """None, because another process cannot inherit a channel in memory."""

    def __init__(self, url: str, simulator: str) -> None:
        self._url = url
        self._board: InProcessBoard | None = InProcessBoard(*_board_and_lines(url, simulator))
        self._board.start()

    def read(self) -> Packet:
        """Wait for data on one channel and return it; ``(0, b"")`` after a while without data.

        Raises LinkError after ``close``.
        """
        if self._board is None:
            raise LinkError(f"lost {self._url} while reading: the driver has closed it")
        return self._board.read(READ_TIMEOUT_S)

    def write(self, packets: Iterable[Packet]) -> None:
        """Write all bytes at once. Raises LinkError after ``close``."""
        if self._board is None:
            raise LinkError(f"lost {self._url} while writing: the driver has closed it")
        for packet in packets:
            self._board.write(packet)

    def write_if_room(self, packets: Iterable[Packet]) -> int:
        """Write all packets, because there is always room; return the number of bytes."""
        packets = tuple(packets)
        self.write(packets)
        return sum(len(data) for _, data in packets)

    def interrupt(self) -> None:
        """End the ``read`` that waits in another thread. If none waits, end the next ``read``."""
        if (board := self._board) is not None:
            board.cancel()

    def close(self) -> None:
        """Power the board off. A second call does nothing."""
        board, self._board = self._board, None
        if board is not None:
            board.cancel()
            board.stop()


def check_address(url: str, simulator: str) -> None:
    """Raise ParameterError if the URL has an option that this simulated board does not have."""
    _board_and_lines(url, simulator)


def _board_and_lines(url: str, simulator: str) -> tuple[SimulatedBoard, list[Line]]:
    try:
        return options.from_url(url, options.load(simulator))
    except options.OptionError as error:
        raise ParameterError(
            f"port '{url}' is not valid: {error}; `ros2 run omnibot_driver"
            f" {options.command(simulator)} --help` lists the options; an example is"
            " sim://?seed=1&lose=0.001"
        ) from error


class InProcessBoard(RunningBoard[SimulatedBoard]):
    """A running simulated board whose channels are in memory."""

    def __init__(self, board: SimulatedBoard, lines: Sequence[Line] = ()) -> None:
        super().__init__(board, lines)
        self._inbox: SimpleQueue[Packet] = SimpleQueue()
        self._outbox: deque[tuple[int, bytearray]] = deque()
        self._came = threading.Condition()
        self._cancelled = False

    def unread(self, channel: int = 0) -> int:
        """Return the number of unread bytes of a serial channel, or of unread datagrams."""
        waiting = [data for number, data in self._outbox if number == channel]
        return len(waiting) if self._has_datagrams(channel) else sum(map(len, waiting))

    def write(self, packet: Packet) -> None:
        """Queue a packet for the board, which receives it at its next tick at the latest."""
        self._inbox.put(packet)

    def read(self, timeout_s: float | None) -> Packet:
        """Return the oldest unread data: one datagram, or consecutive bytes of one channel.

        Returns ``(0, b"")`` after ``timeout_s``, or after ``cancel``.
        """
        with self._came:
            self._came.wait_for(lambda: self._outbox or self._cancelled or self._error, timeout_s)
            self.check()
            self._cancelled = False
            if not self._outbox:
                return 0, b""
            channel, data = self._outbox.popleft()
            return channel, bytes(data)

    def cancel(self) -> None:
        """End the ``read`` that waits in another thread. If none waits, end the next ``read``."""
        with self._came:
            self._cancelled = True
            self._came.notify_all()

    def _receive(self, timeout_s: float) -> Iterator[Packet]:
        try:
            yield self._inbox.get(timeout=timeout_s)
        except Empty:
            return

    def _send(self, channel: int, data: bytes) -> int:
        with self._came:
            taken = data[: self._room(channel, data)]
            if taken or (not data and self._has_datagrams(channel)):
                self._put(channel, taken)
                self._came.notify_all()
        return len(taken)

    def _room(self, channel: int, data: bytes) -> int:
        if self._has_datagrams(channel):
            return len(data) if self.unread(channel) < UNREAD_DATAGRAMS else 0
        return UNREAD_LIMIT - self.unread(channel)

    def _put(self, channel: int, data: bytes) -> None:
        last = self._outbox[-1] if self._outbox else None
        if last is not None and last[0] == channel and not self._has_datagrams(channel):
            last[1].extend(data)
        else:
            self._outbox.append((channel, bytearray(data)))

    def _has_datagrams(self, channel: int) -> bool:
        return self.board.channels[channel].datagrams
