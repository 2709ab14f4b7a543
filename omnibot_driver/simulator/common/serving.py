# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A simulated board in real time for other programs: each channel has its own port.

This module must not know what packets mean.
"""

import os
import select
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

from omnibot_driver.simulator.common.board import Channel, Packet
from omnibot_driver.simulator.common.running import RunningBoard
from omnibot_driver.simulator.common.terminal import Terminal
from omnibot_driver.simulator.common.udp import open_sockets
from omnibot_driver.simulator.common.wired import B, Line


class Carrier(Protocol):
    """An open port for one line (channel) of the simulated board."""

    address: str
    """Value for the driver's port parameter."""
    name: str
    """Symbolic link to the port, or the port's address if there is no link."""
    descriptor: int
    """File descriptor that is readable when data has arrived."""

    def receive(self) -> list[bytes]:
        """Return the data received, in order: chunks of bytes, or datagrams."""

    def send(self, data: bytes) -> int:
        """Send data to the driver; return how many bytes were accepted."""

    def close(self) -> None:
        """Close the port."""


class ServedBoard(RunningBoard[B]):
    """Context manager that runs a board behind pseudo-terminals and UDP ports, at ``addresses``.

    * ``links``: paths of symbolic links, one for each pseudo-terminal. With a single path and
      several pseudo-terminals, the links are PATH-CHANNEL.
    * ``udp_port``: first UDP port, 0 for any free port.

    Raises OSError on entry if a link or a port is unavailable.
    """

    def __init__(
        self,
        board: B,
        lines: Sequence[Line] = (),
        *,
        links: Sequence[str | Path] = (),
        udp_port: int = 0,
    ) -> None:
        super().__init__(board, lines)
        self._links = links
        self._udp_port = udp_port
        self._carriers: list[Carrier] = []

    @property
    def addresses(self) -> list[str]:
        """Values of the driver's port parameters, by channel: a path, or udp://127.0.0.1:PORT."""
        return [carrier.address for carrier in self._carriers]

    @property
    def names(self) -> list[str]:
        """Name of the port of each channel: its symbolic link if it has one, else its address."""
        return [carrier.name for carrier in self._carriers]

    def __enter__(self) -> Self:
        self._carriers = open_carriers(self.board.channels, self._links, self._udp_port)
        self._by_descriptor = {
            carrier.descriptor: (channel, carrier) for channel, carrier in enumerate(self._carriers)
        }
        self.start()
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        try:
            self.stop()
        finally:
            if not self._thread.is_alive():
                for carrier in self._carriers:
                    carrier.close()

    def _receive(self, timeout_s: float) -> Iterator[Packet]:
        readable, _, _ = select.select(list(self._by_descriptor), [], [], timeout_s)
        for descriptor in readable:
            channel, carrier = self._by_descriptor[descriptor]
            for data in carrier.receive():
                yield channel, data

    def _send(self, channel: int, data: bytes) -> int:
        return self._carriers[channel].send(data)


class PtyBoard(ServedBoard[B]):
    """A board with one serial channel, on a pseudo-terminal at ``path``."""

    def __init__(self, board: B, link: str | Path | None = None, line: Line | None = None) -> None:
        super().__init__(
            board, [] if line is None else [line], links=[] if link is None else [link]
        )

    @property
    def path(self) -> str:
        """Path of the pseudo-terminal; empty before it is opened."""
        return self.addresses[0] if self._carriers else ""

    @property
    def line(self) -> Line:
        """The line that the board's bytes pass through."""
        return self._wired.lines[0]


def open_carriers(
    channels: Sequence[Channel], links: Sequence[str | Path] = (), udp_port: int = 0
) -> list[Carrier]:
    """Open one carrier for each channel. Raises OSError if one cannot be opened."""
    names = iter(_one_for_each([c.name for c in channels if not c.datagrams], links))
    with ExitStack() as opened:
        sockets = open_sockets(sum(channel.datagrams for channel in channels), udp_port)
        for one in sockets:
            opened.callback(one.close)
        unused = iter(sockets)
        carriers: list[Carrier] = []
        for channel in channels:
            if channel.datagrams:
                carriers.append(next(unused))
            else:
                carriers.append(terminal := Terminal(next(names)))
                opened.callback(terminal.close)
        opened.pop_all()
    return carriers


def _one_for_each(names: Sequence[str], links: Sequence[str | Path]) -> Sequence[str | Path | None]:
    if not links:
        return [None] * len(names)
    if len(links) == len(names):
        return links
    if len(links) == 1 and names:
        return [f"{os.fspath(links[0])}-{name}" for name in names]
    if not names:
        raise OSError("this board has no serial port to link to")
    raise OSError(
        f"{len(links)} links do not fit a board with {len(names)} serial port"
        f"{'s' if len(names) > 1 else ''}:"
        " give one --link, or one for each port"
    )
