# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of datagrams on the loopback: each packet is one datagram of its channel."""

import contextlib
import os
import re
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from omnibot_driver.core.errors import LinkError, ParameterError
from omnibot_driver.core.packets import Packet
from omnibot_driver.transports import host_name, udp
from omnibot_driver.transports.udp import UdpPorts, check_address

PATIENCE_S = 60.0


class Host:
    """A host with two ports with consecutive numbers."""

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
    """Packets go in both directions. Each packet is one datagram, and packets are never joined."""
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
    """A datagram does not come from the host's address, so the port ignores it.

    Anyone on the network could send such a datagram.
    """
    transport.write(((0, b"hello"),))
    _, driver = host.ports[0].recvfrom(99)
    with socket.socket(type=socket.SOCK_DGRAM) as stranger:
        stranger.bind(("127.0.0.1", 0))
        stranger.sendto(b"ok", driver)
    host.ports[0].sendto(b"true", driver)
    assert next_packet(transport) == (0, b"true")


def test_a_host_that_is_away_is_silent_and_hears_the_first_datagram_when_it_is_back(
    host: Host, transport: UdpPorts
) -> None:
    """The host is away, and a datagram to it causes an error in the kernel. Then the host is back.

    In spite of the error, the next datagram reaches the host.
    """
    address = host.ports[0].getsockname()
    host.ports[0].close()
    transport.write(((0, b"hello"), (1, b"halt")))
    assert host.ports[1].recv(99) == b"halt"
    with socket.socket(type=socket.SOCK_DGRAM) as again:
        again.bind(address)
        again.settimeout(PATIENCE_S)
        transport.write(((0, b"stop"),))
        assert again.recv(99) == b"stop"
    assert transport.read() == (0, b"")


def test_the_channels_take_turns(host: Host, transport: UdpPorts) -> None:
    """Nine datagrams wait on one channel, and one datagram waits on the other channel.

    At most two datagrams of the busy channel are read before the datagram of the other channel.
    """
    transport.write(((0, b"hello"), (1, b"hello")))
    drivers = [port.recvfrom(99)[1] for port in host.ports]
    for _ in range(9):
        host.ports[0].sendto(b"again", drivers[0])
    host.ports[1].sendto(b"once", drivers[1])
    assert (1, b"once") in [next_packet(transport) for _ in range(3)]


def test_a_read_that_waits_can_be_ended(transport: UdpPorts) -> None:
    """A read waits for data, and another thread ends it. The read returns without data."""
    threading.Timer(0.02, transport.interrupt).start()
    assert transport.read() == (0, b"")


@pytest.mark.parametrize(
    "url",
    [
        "udp://",
        "udp://host",
        "udp://:5000",
        "udp://h:5000/x",
        "tcp://h:5000",
        "udp://h:65535",
        "udp://u@h:5000",
        "udp:/h",
        "udp://two..dots:5000",
        f"udp://{64 * 'a'}:5000",
        "/dev/ttyUSB0",
    ],
)
def test_a_url_that_means_no_place_is_refused(url: str) -> None:
    """A URL is wrong. The error shows the correct form.

    Port 65535 is refused, because the second channel would need the next higher port.
    """
    with pytest.raises(ParameterError, match=r"give udp://HOST:PORT with a port up to 65534"):
        check_address(url, 2)


@pytest.mark.parametrize("host", ["no-such-host.invalid", "192.168.1.50", "[::1]", "robot.local."])
def test_a_host_that_may_appear_later_is_not_refused(host: str) -> None:
    """A host name is unknown until the host is on the network. The check of the URL accepts it."""
    check_address(f"udp://{host}:65534", 2)


@pytest.mark.skipif(not Path("/proc/net/if_inet6").exists(), reason="the kernel has no IPv6")
def test_the_address_of_a_lost_host_is_written_as_in_a_url() -> None:
    """The error about a lost host contains the host's IPv6 address in brackets, as in a URL.

    The port in the error is that of the channel to which the driver was writing.
    """
    lost = pytest.raises(LinkError, match=re.escape("lost udp://[::1]:5001: "))
    with contextlib.closing(UdpPorts("udp://[::1]:5000", 2)) as transport, lost:
        transport.write(((1, bytes(100_000)),))


def test_a_host_that_is_not_known_is_reported() -> None:
    """The host is unknown. The error names the parameter, and no file descriptor stays open."""
    before = len(os.listdir("/proc/self/fd"))
    with pytest.raises(LinkError, match="check the parameter `port`"):
        UdpPorts("udp://no-such-host.invalid:5000", 2)
    assert len(os.listdir("/proc/self/fd")) == before


class Names:
    """A name service in which ``robot.local`` has the addresses ``addresses``, or is unknown.

    ``lookups``: semaphore that each lookup of this name releases once. ``gate``: event for which
    each lookup waits.
    """

    def __init__(self) -> None:
        self.addresses = ["127.0.0.1"]
        self.lookups = threading.Semaphore(0)
        self.gate = threading.Event()
        self.gate.set()
        self._real = socket.getaddrinfo

    def look_up(self, host: str, *more: Any, **options: Any) -> list[Any]:
        if host != "robot.local":
            return self._real(host, *more, **options)
        self.lookups.release()
        assert self.gate.wait(PATIENCE_S)
        if not self.addresses:
            raise socket.gaierror(socket.EAI_NONAME, "unknown")
        return [each for ip in self.addresses for each in self._real(ip, *more, **options)]

    def wait_for(self, lookups: int, transport: UdpPorts) -> None:
        """Read until ``lookups`` more lookups of the name have begun.

        Fail if a read returns data.
        """
        end = time.monotonic() + PATIENCE_S
        while lookups:
            assert transport.read() == (0, b"")
            lookups -= self.lookups.acquire(blocking=False)
            assert time.monotonic() < end


@pytest.fixture
def names(monkeypatch: pytest.MonkeyPatch) -> Names:
    names = Names()
    monkeypatch.setattr(socket, "getaddrinfo", names.look_up)
    monkeypatch.setattr(udp, "READ_TIMEOUT_S", 0.001)
    monkeypatch.setattr(host_name, "SILENT_S", 0.0)
    return names


def test_a_host_with_both_kinds_of_address_is_reached_by_ipv4(host: Host, names: Names) -> None:
    """The name service names an IPv6 address first, and the host listens only at its IPv4 address.

    The datagrams reach the host.
    """
    names.addresses = ["::1", "127.0.0.1"]
    with contextlib.closing(UdpPorts(f"udp://robot.local:{host.number}")) as transport:
        transport.write(((0, b"hello"),))
        assert host.ports[0].recv(9) == b"hello"


@pytest.fixture
def named(host: Host, names: Names) -> Iterator[UdpPorts]:
    transport = UdpPorts(f"udp://robot.local:{host.number}", 2)
    assert names.lookups.acquire(blocking=False)
    yield transport
    transport.close()


def test_a_silent_host_with_another_address_is_lost(names: Names, named: UdpPorts) -> None:
    """A host is silent, and its name gets another address. The read fails, and says why.

    The reader then opens the port again, at the new address.
    """
    names.wait_for(2, named)
    names.addresses = ["127.0.0.2", "127.0.0.3"]
    with pytest.raises(LinkError, match=r"the address of robot\.local has changed"):
        names.wait_for(1_000_000, named)


@pytest.mark.parametrize("addresses", [[], ["127.0.0.2", "127.0.0.1"]])
def test_a_silent_host_that_may_have_the_same_address_is_not_lost(
    addresses: list[str], names: Names, named: UdpPorts
) -> None:
    """A host is silent. A lookup of its name fails, or still finds the address in use.

    The driver does not report that the host is lost.
    """
    names.addresses = addresses
    names.wait_for(5, named)


def test_a_slow_lookup_does_not_hold_up_the_data(host: Host, names: Names, named: UdpPorts) -> None:
    """A lookup waits for the name service. Meanwhile data is read, and no second lookup begins."""
    named.write(((0, b"hello"),))
    _, driver = host.ports[0].recvfrom(99)
    names.gate.clear()
    names.wait_for(1, named)
    for _ in range(20):
        assert named.read() == (0, b"")
    assert not names.lookups.acquire(blocking=False)
    host.ports[0].sendto(b"ok", driver)
    assert next_packet(named) == (0, b"ok")
    names.gate.set()


def test_an_answer_is_read_although_the_name_has_another_address(
    host: Host, named: UdpPorts, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A lookup shows another address, but the host answers at the old one: the answer is read."""
    named.write(((0, b"hello"),))
    _, driver = host.ports[0].recvfrom(99)
    host.ports[0].sendto(b"ok", driver)
    monkeypatch.setattr(host_name.HostName, "has_moved", lambda _: True)
    assert named.read() == (0, b"ok")
    with pytest.raises(LinkError, match="has changed"):
        named.read()


def test_a_lookup_that_ends_after_an_answer_is_not_used(names: Names, named: UdpPorts) -> None:
    """A host answers while its name is looked up. Then the lookup finds another address.

    The port ignores this address. If the host falls silent again, the port stays open at least
    until a new lookup has ended.
    """
    names.wait_for(1, named)
    while named._name._looks_up:
        time.sleep(0.001)  # no event says that a lookup has ended
    named._name.heard()
    named._name._left = True  # the lookup ends now
    names.gate.clear()
    for _ in range(20):
        assert named.read() == (0, b"")
    names.gate.set()


def test_a_lookup_that_cannot_be_started_does_not_end_the_reading(
    names: Names, named: UdpPorts, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The system can start no thread at present, so no lookup begins. The port stays open."""

    def start(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    with monkeypatch.context() as exhausted:
        exhausted.setattr(threading.Thread, "start", start)
        assert named.read() == (0, b"")
    names.wait_for(1, named)


def test_a_host_that_answers_is_not_looked_up(
    host: Host, names: Names, named: UdpPorts, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each datagram of the host postpones the next lookup of its name."""
    named.write(((0, b"hello"),))
    _, driver = host.ports[0].recvfrom(99)
    monkeypatch.setattr(host_name, "SILENT_S", PATIENCE_S)
    host.ports[0].sendto(b"ok", driver)
    while named.read() != (0, b"ok"):
        pass
    while names.lookups.acquire(blocking=False):
        pass
    for _ in range(20):
        named.read()
    assert not names.lookups.acquire(blocking=False)


def test_an_address_is_not_looked_up(
    host: Host, names: Names, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The URL has an address instead of a name. An address cannot change, so no lookup begins."""
    with contextlib.closing(UdpPorts(host.url, 2)) as transport:
        monkeypatch.setattr(
            socket, "getaddrinfo", lambda *_, **__: pytest.fail("the address was looked up")
        )
        for _ in range(20):
            assert transport.read() == (0, b"")
        assert "omnibot-name" not in [thread.name for thread in threading.enumerate()]
