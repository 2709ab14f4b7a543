# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of serial ports on a network, which are used like local ones."""

import contextlib
import ctypes
import os
import socket
import struct
import threading
import time
from collections.abc import Callable
from contextlib import closing

import pytest
import serial
import serial.rfc2217
from listener import PATIENCE_S, STOP

from omnibot_driver.core.errors import LinkError
from omnibot_driver.core.packets import packed
from omnibot_driver.transports.serial_port import PEER_OPTIONS, SerialPort

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


def connected(server: socket.socket) -> tuple[SerialPort, socket.socket]:
    """Return a port that is connected to this server, and the server's socket of the connection."""
    port = SerialPort(f"socket://127.0.0.1:{server.getsockname()[1]}", 115200)
    return port, server.accept()[0]


@pytest.mark.parametrize("said", [STOP, b""], ids=["spoken to", "not spoken to"])
def test_a_peer_that_vanished_without_a_word_is_given_up(
    monkeypatch: pytest.MonkeyPatch, said: bytes
) -> None:
    """The peer of a port vanishes without closing the connection, so writes raise no error.

    After a while the port notices the loss, and a read raises LinkError.
    """
    options = {**PEER_OPTIONS, socket.TCP_USER_TIMEOUT: 300}
    monkeypatch.setattr("omnibot_driver.transports.serial_port.PEER_OPTIONS", options)
    with socket.create_server(("127.0.0.1", 0)) as server:
        port, far = connected(server)
        with far, closing(port):
            drop_everything(far)
            port.write(packed(said))
            with pytest.raises(LinkError, match="lost"):
                go_on(port.read)


def go_on(action: Callable[[], object]) -> None:
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        action()


def drop_everything(peer: socket.socket) -> None:
    """Let the kernel discard all data that arrives at this socket, by a packet filter."""
    program = ctypes.create_string_buffer(struct.pack("HBBI", 0x06, 0, 0, 0))
    so_attach_filter = 26
    peer.setsockopt(
        socket.SOL_SOCKET, so_attach_filter, struct.pack("HP", 1, ctypes.addressof(program))
    )


def test_a_peer_that_reads_nothing_ends_a_write_with_an_error() -> None:
    """The peer reads nothing. When all buffers are full, a write raises LinkError."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        port, far = connected(server)
        with far, closing(port), pytest.raises(LinkError, match="while writing"):
            go_on(lambda: port.write(packed(bytes(100_000))))


def test_a_board_behind_a_socket_is_served_as_well() -> None:
    """The port has a URL of pyserial, ``socket://HOST:PORT``, and works like a local port."""
    server = socket.create_server(("127.0.0.1", 0))
    port = SerialPort(f"socket://127.0.0.1:{server.getsockname()[1]}", 115200)
    far, _ = server.accept()
    far.sendall(b"Paused: 0 \n")
    received = b""
    while len(received) < 11:
        received += port.read()[1]
    assert received == b"Paused: 0 \n"
    port.write(packed(STOP))
    assert far.recv(100) == STOP
    far.close()
    with pytest.raises(LinkError, match="lost"):
        port.read()
    port.close()
    server.close()


def test_a_peer_that_broke_off_leaves_no_socket_open() -> None:
    """The peer breaks the connection off. The port closes its socket.

    pyserial itself would leave the socket open.
    """
    with socket.create_server(("127.0.0.1", 0)) as server:
        descriptors = len(os.listdir("/proc/self/fd"))
        port, far = connected(server)
        far.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        far.close()
        with pytest.raises(LinkError, match="lost"):
            go_on(port.read)
        port.close()
        assert len(os.listdir("/proc/self/fd")) == descriptors


@pytest.mark.filterwarnings("ignore:set(Daemon|Name)")  # pyserial 3.5
@pytest.mark.parametrize("scheme", ["rfc2217", "RFC2217"])
def test_a_board_behind_rfc2217_is_served_as_well(scheme: str) -> None:
    """A port on a server that uses RFC 2217 works like a local one.

    The scheme of the URL may be in upper or lower case.
    """
    board_side = serial.serial_for_url("loop://", timeout=0.05)
    listener = socket.create_server(("127.0.0.1", 0))
    done = threading.Event()

    def serve() -> None:
        client, _ = listener.accept()
        client.settimeout(0.05)
        manager = serial.rfc2217.PortManager(board_side, Connection(client))
        while not done.is_set():
            with contextlib.suppress(TimeoutError):
                board_side.write(b"".join(manager.filter(client.recv(1024))))
            if data := board_side.read(board_side.in_waiting):
                client.sendall(b"".join(manager.escape(data)))
        client.close()

    server = threading.Thread(target=serve)
    server.start()
    port = SerialPort(f"{scheme}://127.0.0.1:{listener.getsockname()[1]}", 115200)
    port.write(packed(b"Paused: 0 \n"))
    received = b""
    while len(received) < 11:
        received += port.read()[1]
    assert received == b"Paused: 0 \n"
    port.close()
    done.set()
    server.join(PATIENCE_S)
    listener.close()


class Connection:
    """The parts of a connection that the PortManager of pyserial needs."""

    def __init__(self, client: socket.socket) -> None:
        self._client = client

    def write(self, data: bytes) -> None:
        self._client.sendall(data)
