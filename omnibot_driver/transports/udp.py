# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Datagrams to one host: ``udp://host:port``, each further channel one port higher.

A packet is one datagram. Only what comes from the address that is written to is heard. Nothing is
lost in silence: a host whose port is closed answers that, and it is a LinkError.
"""

import contextlib
import os
import select
import socket
import time
from typing import Final
from urllib.parse import urlsplit

from omnibot_driver.core.errors import LinkError
from omnibot_driver.core.packets import Packet, Packets
from omnibot_driver.transports import READ_TIMEOUT_S, WRITE_TIMEOUT_S

SCHEME: Final = "udp://"
LARGEST: Final = 65_536


class UdpPorts:
    """A ``Transport`` of as many channels as ``channels`` says."""

    ends_with_us = False
    overruns = None

    def __init__(self, url: str, channels: int = 1) -> None:
        self._url = url
        self._host, self._port = _place(url, channels)
        self._sockets: list[socket.socket] = []
        self._wakes, self._wake = os.pipe()
        try:
            for number in range(channels):
                self._sockets.append(self._connected(self._port + number))
        except OSError as error:
            self.close()
            raise LinkError(
                f"cannot reach {url}: {error.strerror or error}; check the parameter `port` and"
                " the network"
            ) from error
        self._arrivals = select.poll()
        self._channels = {ours.fileno(): number for number, ours in enumerate(self._sockets)}
        for descriptor in (self._wakes, *self._channels):
            self._arrivals.register(descriptor, select.POLLIN)

    @property
    def descriptors(self) -> tuple[int, ...] | None:
        """Connected sockets: each write is a datagram."""
        return tuple(ours.fileno() for ours in self._sockets)

    def read(self) -> Packet:
        """One datagram."""
        for ready, _ in self._arrivals.poll(1e3 * READ_TIMEOUT_S):
            if ready == self._wakes:
                os.read(ready, 1000)
                break
            channel = self._channels[ready]
            try:
                return channel, self._sockets[channel].recv(LARGEST)
            except BlockingIOError:
                continue
            except OSError as error:
                raise self._lost(channel, error) from error
        return 0, b""

    def write(self, packets: Packets) -> None:
        """Each a datagram."""
        until = time.monotonic() + WRITE_TIMEOUT_S
        failed: LinkError | None = None
        for channel, data in packets:
            try:
                self._send(channel, data, until)
            except OSError as error:
                failed = failed or self._lost(channel, error)
        if failed is not None:
            raise failed

    def write_if_room(self, packets: Packets) -> None:
        """Those that are taken at once."""
        for channel, data in packets:
            with contextlib.suppress(OSError):
                self._sockets[channel].send(data)

    def interrupt(self) -> None:
        """End a ``read`` that waits in another thread."""
        with contextlib.suppress(OSError):
            os.write(self._wake, b"\0")

    def close(self) -> None:
        """Harmless to repeat."""
        for ours in self._sockets:
            ours.close()
        for descriptor in (self._wakes, self._wake):
            if descriptor >= 0:
                os.close(descriptor)
        self._sockets, self._wakes, self._wake = [], -1, -1

    def _connected(self, port: int) -> socket.socket:
        family, kind, protocol, _, address = socket.getaddrinfo(
            self._host, port, type=socket.SOCK_DGRAM
        )[0]
        ours = socket.socket(family, kind, protocol)
        try:
            ours.connect(address)
        except OSError:
            ours.close()
            raise
        ours.setblocking(False)
        return ours

    def _send(self, channel: int, data: bytes, until: float) -> None:
        while True:
            try:
                self._sockets[channel].send(data)
            except BlockingIOError:
                left_s = max(0.0, until - time.monotonic())
                if not select.select([], [self._sockets[channel]], [], left_s)[1]:
                    raise TimeoutError(f"it takes nothing for {WRITE_TIMEOUT_S:g} s") from None
            else:
                return

    def _lost(self, channel: int, error: OSError) -> LinkError:
        place = f"{SCHEME}{self._host}:{self._port + channel}"
        if isinstance(error, ConnectionRefusedError):
            return LinkError(
                f"nothing listens at {place}: start the controller there, or check the parameter"
                " `port`"
            )
        return LinkError(f"lost {place}: {error.strerror or error}; check the network")


def _place(url: str, channels: int) -> tuple[str, int]:
    try:
        parts = urlsplit(url)
        host, port = parts.hostname, parts.port
        fits = port is not None and port > 0 and port + channels <= 65_536
        if parts.scheme == "udp" and host and port and fits and not (parts.path or parts.query):
            return host, port
    except ValueError:
        pass
    raise LinkError(f"port '{url}' is not understood: give udp://HOST:PORT, or sim://")
