# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Datagrams to one host: ``udp://host:port``. Each further channel uses the next higher port.

If the name of a silent host has a new address, ``read`` raises LinkError.
"""

import contextlib
import errno
import math
import select
import socket
import time
from typing import Final
from urllib.parse import urlsplit

from omnibot_driver.core.errors import LinkError, ParameterError
from omnibot_driver.core.packets import Packet, Packets
from omnibot_driver.transports import NONE_MISSING, READ_TIMEOUT_S, WRITE_TIMEOUT_S
from omnibot_driver.transports.host_name import HostName
from omnibot_driver.transports.wake_up import WakeUp

SCHEME: Final = "udp://"
LARGEST: Final = 65_536
UNREACHABLE: Final = (errno.ECONNREFUSED, errno.EHOSTUNREACH, errno.ENETUNREACH, errno.EHOSTDOWN)
"""Errors that the network reports for a datagram without a receiver."""


class UdpPorts:
    """A ``Transport`` with one connected socket for each channel.

    ``channels``: the number of channels.

    Raises ParameterError if the URL is wrong.
    """

    ends_with_us = False
    missing = NONE_MISSING
    overruns = None

    def __init__(self, url: str, channels: int = 1) -> None:
        self._host, self._port = _place(url, channels)
        self._sockets: list[socket.socket] = []
        try:
            self._wake_up = WakeUp()
            try:
                self._connect(channels)
            except BaseException:
                self.close()
                raise
        except OSError as error:
            reason = getattr(error, "strerror", None) or error
            raise LinkError(
                f"cannot reach {url}: {reason}; check the parameter `port` and the network"
            ) from error
        self._arrivals = select.poll()
        self._channels = {ours.fileno(): number for number, ours in enumerate(self._sockets)}
        for descriptor in (self._wake_up.descriptor, *self._channels):
            self._arrivals.register(descriptor, select.POLLIN)
        self._ready: list[int] = []

    @property
    def descriptors(self) -> tuple[int, ...] | None:
        """Descriptors of the connected sockets. Each write to one of them sends one datagram."""
        return tuple(ours.fileno() for ours in self._sockets)

    def read(self) -> Packet:
        """Return one datagram and its channel, or ``(0, b"")`` if none arrives within 0.2 s.

        Raises LinkError if the connection is lost, or a silent host has another address now.
        """
        if not self._ready:
            self._ready = [ready for ready, _ in self._arrivals.poll(1e3 * READ_TIMEOUT_S)]
        if not self._ready:
            if self._name.has_moved():
                raise LinkError(
                    f"the address of {self._host} has changed; the driver connects to the new"
                    " address"
                )
            return 0, b""
        ready = self._ready.pop()
        if ready == self._wake_up.descriptor:
            self._wake_up.answer()
            return 0, b""
        channel = self._channels[ready]
        try:
            data = self._sockets[channel].recv(LARGEST)
        except OSError as error:
            if _is_silence(error):
                return 0, b""
            raise self._lost(channel, error) from error
        self._name.heard()
        return channel, data

    def write(self, packets: Packets) -> None:
        """Write each packet as a datagram."""
        until = time.monotonic() + WRITE_TIMEOUT_S
        failed: LinkError | None = None
        for channel, data in packets:
            try:
                self._send(channel, data, until)
            except OSError as error:
                if not _is_silence(error):
                    failed = failed or self._lost(channel, error)
        if failed is not None:
            raise failed

    def write_if_room(self, packets: Packets) -> int:
        """Write the datagrams that are accepted without waiting; return how many bytes."""
        taken = 0
        for channel, data in packets:
            with contextlib.suppress(OSError):
                self._send(channel, data, until=-math.inf)
                taken += len(data)
        return taken

    def interrupt(self) -> None:
        """End a ``read`` that waits in another thread."""
        self._wake_up.ring()

    def close(self) -> None:
        """Close the sockets. A second call does nothing."""
        for ours in self._sockets:
            ours.close()
        self._sockets = []
        self._wake_up.close()

    def _connect(self, channels: int) -> None:
        """Connect the sockets of all channels to the same address of the host.

        IPv4 is preferred, because motor controllers seldom know IPv6.
        """
        found = socket.getaddrinfo(self._host, self._port, type=socket.SOCK_DGRAM)
        family, kind, protocol, _, (address, _, *rest) = min(
            found, key=lambda place: place[0] != socket.AF_INET
        )
        self._name = HostName(self._host, str(address))
        for number in range(channels):
            ours = socket.socket(family, kind, protocol)
            self._sockets.append(ours)
            ours.connect((address, self._port + number, *rest))
            ours.setblocking(False)

    def _send(self, channel: int, data: bytes, until: float) -> None:
        ours = self._sockets[channel]
        may_be_stale = True
        while True:
            try:
                ours.send(data)
            except BlockingIOError:
                room = select.poll()
                room.register(ours, select.POLLOUT)
                if not room.poll(max(0.0, 1e3 * (until - time.monotonic()))):
                    raise TimeoutError(
                        f"it has not accepted all data within {WRITE_TIMEOUT_S:g} s"
                    ) from None
            except OSError as error:
                if not (may_be_stale and _is_silence(error)):
                    raise
                may_be_stale = False  # the error of an earlier datagram; this one was not sent
            else:
                return

    def _lost(self, channel: int, error: OSError) -> LinkError:
        host = f"[{self._host}]" if ":" in self._host else self._host
        place = f"{SCHEME}{host}:{self._port + channel}"
        return LinkError(f"lost {place}: {error.strerror or error}; check the network")


def check_address(url: str, channels: int = 1) -> None:
    """Raise ParameterError if this is not the address of a host.

    A host that is unknown at present is accepted, because the host may appear later.
    """
    _place(url, channels)


def _is_silence(error: OSError) -> bool:
    """Return whether the error only means that the addressed host does not listen at present."""
    return isinstance(error, BlockingIOError) or error.errno in UNREACHABLE


def _place(url: str, channels: int) -> tuple[str, int]:
    try:
        parts = urlsplit(url)
        host, port = parts.hostname, parts.port
        fits = port is not None and port > 0 and port + channels <= 65_536
        more = parts.path or parts.query or parts.fragment or parts.username is not None
        if parts.scheme == "udp" and host and port and fits and not more:
            host.encode("idna")
            return host, port
    except ValueError:
        pass
    raise ParameterError(
        f"port '{url}' is not valid: give udp://HOST:PORT with a port up to {65_536 - channels},"
        " or sim:// for a simulated board; check the parameter `board` too"
    )
