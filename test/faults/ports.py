# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Boards whose port can be stuck, full or half-open, or can disappear without notice.

This module does not depend on the format of the frames.
"""

import contextlib
import ctypes
import os
import select
import socket
import struct
import termios
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Any, Self

from driver_process import PATIENCE_S
from terminal import fill

from omnibot_driver.simulator.common.board import Packet
from omnibot_driver.simulator.common.running import RunningBoard
from omnibot_driver.simulator.common.serving import PtyBoard

SO_ATTACH_FILTER, SO_DETACH_FILTER = 26, 27
DROP_ALL = struct.pack("HBBI", 0x06, 0, 0, 0)
"""A packet filter with a single instruction: discard every packet."""


class Terminal(PtyBoard):
    """A pseudo-terminal with a board.

    ``deaf``: if true, the adapter does not read the kernel's buffer, but it still sends.
    """

    deaf = False

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._heard_all = threading.Event()

    def _receive(self, timeout_s: float) -> Iterable[Packet]:
        if self.deaf:
            time.sleep(timeout_s)  # in place of the read, which lasts for a tick
            return []
        heard = list(super()._receive(timeout_s))
        if not heard:
            self._heard_all.set()
        return heard

    @contextmanager
    def full(self, old: bytes) -> Iterator[None]:
        """Fill the kernel's buffer with ``old`` commands (20 kB) while the board does not read.

        At the end of the ``with`` block, wait until the board has received these commands.
        """
        self.deaf = True
        near = os.open(self.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        fill(near, old, full_s=0.05)  # short, so that the driver still has the port open
        try:
            yield
        finally:
            os.close(near)
            self._heard_all.clear()
            self.deaf = False
            assert self.wait_for(lambda _: self._heard_all.is_set(), PATIENCE_S)

    @contextmanager
    def kept_full(self, old: bytes) -> Iterator[None]:
        """Keep the kernel's buffer full, even if the driver discards its content.

        The method suspends the output of the pseudo-terminal until the end of the ``with`` block.
        """
        near = os.open(self.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            with self.full(old):
                termios.tcflow(near, termios.TCOOFF)
                try:
                    yield
                finally:
                    termios.tcflow(near, termios.TCOON)
        finally:
            os.close(near)


class Server(RunningBoard):
    """A board behind a serial-port server on the network.

    ``deaf``: whether the server holds back data to the board.

    ``mute``: whether the server holds back data from the board.

    ``accepted_at``: for each connection, the board's tick at which it was accepted.
    """

    deaf = mute = False

    def __init__(self, board: Any, number: int) -> None:
        super().__init__(board)
        self.accepted_at: list[int] = []
        self._listener = socket.create_server(("127.0.0.1", number))
        self._peers: list[socket.socket] = []

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.stop()
        for each in (self._listener, *self._peers):
            each.close()

    def close_from_here(self) -> None:
        """Close only the direction to the driver. The server still accepts data."""
        with self.lock:
            self._peers[-1].shutdown(socket.SHUT_WR)

    def vanish(self) -> None:
        """Cut the network.

        All packets are dropped, and neither side receives a message that the connection closes.
        """
        program = ctypes.create_string_buffer(DROP_ALL)
        rule = struct.pack("HP", 1, ctypes.addressof(program))
        self.deaf = self.mute = True
        with self.lock:
            for each in (self._listener, *self._peers):
                each.setsockopt(socket.SOL_SOCKET, SO_ATTACH_FILTER, rule)

    def come_back(self) -> None:
        """Restore the network for new connections. The old connections stay cut."""
        self._listener.setsockopt(socket.SOL_SOCKET, SO_DETACH_FILTER, 0)
        self.deaf = self.mute = False

    def _receive(self, timeout_s: float) -> Iterable[Packet]:
        heard = [] if self.deaf else list(self._peers)
        readable = select.select([self._listener, *heard], [], [], timeout_s)[0]
        with self.lock:
            if self._listener in readable:
                peer, _ = self._listener.accept()
                peer.setblocking(False)
                self._peers.append(peer)
                self.accepted_at.append(self.board.tick)
            return [(0, self._hear(peer)) for peer in heard if peer in readable]

    def _hear(self, peer: socket.socket) -> bytes:
        data = b""
        with contextlib.suppress(OSError):
            data = peer.recv(4096)
        if not data:
            self._peers.remove(peer)
            peer.close()
        return data

    def _send(self, channel: int, data: bytes) -> int:
        if not self._peers or self.mute:
            return 0
        try:
            return self._peers[-1].send(data) if data else 0
        except OSError:
            return 0
