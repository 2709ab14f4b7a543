# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Datagrams on the loopback: a packet each way is one datagram of its channel."""

import socket
import threading
import time
from collections.abc import Iterator

import pytest

from omnibot_driver.core.errors import LinkError
from omnibot_driver.core.packets import Packet
from omnibot_driver.transports.udp import UdpPorts

PATIENCE_S = 20.0


class Host:
    """Two ports, one above the other."""

    def __init__(self) -> None:
        while True:
            self.ports = [socket.socket(type=socket.SOCK_DGRAM) for _ in range(2)]
            self.ports[0].bind(("127.0.0.1", 0))
            self.number = self.ports[0].getsockname()[1]
            try:
                self.ports[1].bind(("127.0.0.1", self.number + 1))
                break
            except OSError:
                self.close()
        for port in self.ports:
            port.settimeout(PATIENCE_S)

    @property
    def url(self) -> str:
        return f"udp://127.0.0.1:{self.number}"

    def close(self) -> None:
        for port in self.ports:
            port.close()


@pytest.fixture
def host() -> Iterator[Host]:
    host = Host()
    yield host
    host.close()


@pytest.fixture
def transport(host: Host) -> Iterator[UdpPorts]:
    transport = UdpPorts(host.url, 2)
    yield transport
    transport.close()


def next_packet(transport: UdpPorts) -> Packet:
    end = time.monotonic() + PATIENCE_S
    while not (packet := transport.read())[1]:
        assert time.monotonic() < end
    return packet


def test_each_packet_is_a_datagram_of_its_channel(host: Host, transport: UdpPorts) -> None:
    """In both directions, and never joined."""
    transport.write(((0, b"one"), (0, b"two"), (1, b"halt")))
    (first, driver), (second, _) = host.ports[0].recvfrom(99), host.ports[0].recvfrom(99)
    assert (first, second) == (b"one", b"two")
    data, stopper = host.ports[1].recvfrom(99)
    assert data == b"halt"
    host.ports[0].sendto(b"ok", driver)
    host.ports[0].sendto(b"fail", driver)
    assert [next_packet(transport), next_packet(transport)] == [(0, b"ok"), (0, b"fail")]
    host.ports[1].sendto(b"halted", stopper)
    assert next_packet(transport) == (1, b"halted")


def test_what_comes_from_another_address_is_not_heard(host: Host, transport: UdpPorts) -> None:
    """Anybody on the network can send to a port."""
    transport.write(((0, b"hello"),))
    _, driver = host.ports[0].recvfrom(99)
    with socket.socket(type=socket.SOCK_DGRAM) as stranger:
        stranger.bind(("127.0.0.1", 0))
        stranger.sendto(b"ok", driver)
    host.ports[0].sendto(b"true", driver)
    assert next_packet(transport) == (0, b"true")


def talk(transport: UdpPorts) -> None:
    for _ in range(100):
        transport.write(((0, b"hello"), (1, b"halt")))
        transport.read()


def test_a_port_where_nothing_listens_is_named_with_what_to_do(
    host: Host, transport: UdpPorts
) -> None:
    """The other one is still written to."""
    host.ports[0].close()
    with pytest.raises(LinkError, match=rf"listens at {host.url}: start the controller"):
        talk(transport)
    assert host.ports[1].recv(99) == b"halt"


def test_a_read_that_waits_can_be_ended(transport: UdpPorts) -> None:
    """And then nothing was read."""
    threading.Timer(0.02, transport.interrupt).start()
    assert transport.read() == (0, b"")


@pytest.mark.parametrize(
    "url",
    ["udp://", "udp://host", "udp://:5000", "udp://h:5000/x", "tcp://h:5000", "udp://h:65535"],
)
def test_a_url_that_means_no_place_is_refused(url: str) -> None:
    """With the form that it must have; the stop port is one higher."""
    with pytest.raises(LinkError, match=r"give udp://HOST:PORT"):
        UdpPorts(url, 2)


def test_a_host_that_is_not_known_is_refused() -> None:
    """Whatever the resolver says of it."""
    with pytest.raises(LinkError, match="check the parameter `port`"):
        UdpPorts("udp://no-such-host.invalid:5000", 2)
