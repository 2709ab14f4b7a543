# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""UDP sockets that carry the datagram channels of a simulated board.

This module knows sockets. It must not know what the datagrams mean.
"""

import contextlib
import errno
import socket

HOST = "127.0.0.1"
"""Loopback address, so that other computers cannot drive a simulated robot."""

LARGEST = 65_535
_TRIES = 100


class UdpSocket:
    """A bound socket, which sends to the sender of the last datagram that it received."""

    def __init__(self, bound: socket.socket) -> None:
        bound.setblocking(False)
        self._socket = bound
        self._peer: tuple[str, int] | None = None
        self.descriptor = bound.fileno()
        self.address = self.name = f"udp://{HOST}:{bound.getsockname()[1]}"

    def receive(self) -> list[bytes]:
        """Return all datagrams that have arrived; a datagram may be empty."""
        datagrams = []
        with contextlib.suppress(BlockingIOError):
            while True:
                datagram, self._peer = self._socket.recvfrom(LARGEST)
                datagrams.append(datagram)
        return datagrams

    def send(self, data: bytes) -> int:
        """Send a datagram to the driver, and return the number of bytes that were sent.

        0: the driver's address is unknown, or an error occurred.
        """
        if self._peer is None:
            return 0
        try:
            return self._socket.sendto(data, self._peer)
        except OSError:
            return 0

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


def open_sockets(count: int, port: int = 0) -> list[UdpSocket]:
    """Open ``count`` sockets on consecutive ports, beginning with ``port``.

    If ``port`` is 0, the first port is any free one. Raises OSError if one of the ports is not free
    or does not exist.
    """
    if not 0 <= port <= LARGEST - count + 1:
        raise OSError(
            f"--udp-port {port}: there is no such port; choose 1 to {LARGEST - count + 1}"
        )
    for _ in range(1 if port else _TRIES):
        try:
            return _in_a_row(count, port)
        except OSError as error:
            if error.errno not in (errno.EADDRINUSE, errno.EACCES):
                raise
            refused = error
    what = f"port {port}" if count == 1 else f"ports {port} to {port + count - 1}"
    raise OSError(
        f"cannot listen on UDP {what} ({refused.strerror}); choose another port with --udp-port"
    ) from refused


def _in_a_row(count: int, port: int) -> list[UdpSocket]:
    with contextlib.ExitStack() as opened:
        sockets = []
        for _ in range(count):
            if port > LARGEST:  # the system chose the highest port for the first channel
                raise OSError(errno.EADDRINUSE, "no higher port")
            one = opened.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            one.bind((HOST, port))
            sockets.append(one)
            port = one.getsockname()[1] + 1
        opened.pop_all()
    return [UdpSocket(one) for one in sockets]
