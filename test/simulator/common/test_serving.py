# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of boards with several lines or with datagrams, in real time."""

import os
import socket
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

import pytest
from toy_lines import DRIVE, FRONT, ToyLines
from toy_udp import ToyServer

from omnibot_driver.simulator.common.board import Channel
from omnibot_driver.simulator.common.serving import ServedBoard, open_carriers
from omnibot_driver.simulator.common.udp import LARGEST, open_sockets

pytestmark = pytest.mark.usefixtures("nothing_left_behind")

PATIENCE_S = 20.0
TWO_PORTS = (Channel("command", datagrams=True), Channel("stop", "", datagrams=True))


@pytest.fixture
def client() -> Iterator[socket.socket]:
    """Yield the UDP socket of a program on the same computer."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        client.settimeout(PATIENCE_S)
        yield client


def place(address: str) -> tuple[str, int]:
    """Return the host and the port of an address, which has the form that the simulator prints."""
    scheme, host, port = address.split(":")
    assert scheme == "udp"
    return host.removeprefix("//"), int(port)


@pytest.mark.slow
def test_each_serial_channel_has_a_terminal_of_its_own() -> None:
    """A board has two serial channels, and each has its own terminal.

    A terminal carries only the commands and reports of its own channel.
    """
    with ServedBoard(ToyLines()) as served, ExitStack() as stack:
        ports = [os.open(path, os.O_RDWR | os.O_NOCTTY) for path in served.addresses]
        for port in ports:
            stack.callback(os.close, port)
        os.write(ports[FRONT], b"angle 30\n")
        os.write(ports[DRIVE], b"go 0.5 0\n")
        assert served.wait_for(lambda board: board.angle_deg == 30.0, PATIENCE_S)
        assert served.wait_for(lambda board: board.pose[0] > 0.1, PATIENCE_S)
        assert os.read(ports[FRONT], 4).startswith(b"fwl ")
        assert os.read(ports[DRIVE], 4).startswith(b"odo ")


def test_one_link_leads_to_several_terminals_by_their_names(tmp_path: Path) -> None:
    """A user gives one link for a board with two terminals.

    Each terminal gets its own link, named after its channel, such as ``board-drive``.
    """
    with ServedBoard(ToyLines(), links=[tmp_path / "board"]) as served:
        assert served.names == [str(tmp_path / "board-drive"), str(tmp_path / "board-front")]
        assert [os.readlink(name) for name in served.names] == served.addresses
    assert os.listdir(tmp_path) == []


def test_or_each_terminal_gets_its_own_link(tmp_path: Path) -> None:
    """A user gives the simulator one symbolic link for each terminal of the board.

    The first link leads to the first terminal, and the second link to the second terminal.
    """
    links = [tmp_path / "a", tmp_path / "b"]
    with ServedBoard(ToyLines(), links=links) as served:
        assert [os.readlink(link) for link in links] == served.addresses


def test_links_that_do_not_fit_are_refused_and_nothing_stays_open(tmp_path: Path) -> None:
    """If one of the requested symbolic links cannot be made, the program makes none of them.

    Cases: too few serial ports, a file with the name of a link, a board with only a UDP port.
    """
    three = [tmp_path / name for name in "abc"]
    with pytest.raises(OSError, match=r"3 links do not fit a board with 2 serial ports"):
        open_carriers(ToyLines.channels, three)
    three[1].write_text("data")
    with pytest.raises(FileExistsError, match="choose another name"):
        open_carriers(ToyLines.channels, three[:2])
    with pytest.raises(OSError, match="no serial port to link to"):
        open_carriers(ToyServer.channels, three[:1])
    assert os.listdir(tmp_path) == ["b"]


def test_a_datagram_is_answered_to_its_sender(client: socket.socket) -> None:
    """Two programs send requests over UDP. Each program gets the reply to its own request.

    A reply is one datagram.
    """
    with ServedBoard(ToyServer()) as served:
        client.sendto(b"odo", place(served.addresses[0]))
        assert client.recv(100) == b"ok 0.000"
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            other.settimeout(PATIENCE_S)
            other.sendto(b"move 0.01", place(served.addresses[0]))
            assert other.recv(100) == b"ok 0.010"


def test_empty_datagrams_and_several_at_once_come_apart(client: socket.socket) -> None:
    """Several datagrams wait at the same time, one of them empty.

    The board gets each of them separately.
    """
    with ServedBoard(ToyServer()) as served:
        with served.lock:  # they wait in the socket
            for data in (b"odo", b"", b"odo"):
                client.sendto(data, place(served.addresses[0]))
        assert [client.recv(100) for _ in range(3)] == [b"ok 0.000", b"fail", b"ok 0.000"]


def test_what_nobody_asked_for_is_dropped_and_counted() -> None:
    """A board sends datagrams before a host has sent a request, so no host is known.

    The simulator drops these datagrams and counts them.
    """

    class Talking(ToyServer):
        def advance(self) -> list[tuple[int, bytes]]:
            return [(0, b"hello")]

    with ServedBoard(Talking()) as served:
        assert served.wait_for(lambda board: served.dropped >= 50, PATIENCE_S)


def test_datagram_channels_stand_on_ports_in_a_row() -> None:
    """The channels of a board have consecutive UDP ports, only on the loopback address.

    A user can choose the first port.
    """
    sockets = open_sockets(2)
    first, second = (place(one.address) for one in sockets)
    for one in sockets:
        one.close()
    assert first[0] == second[0] == "127.0.0.1"
    assert second[1] == first[1] + 1
    carriers = open_carriers(TWO_PORTS, udp_port=first[1])
    for one in carriers:
        one.close()
    assert [place(one.address) for one in carriers] == [first, second]


def test_a_first_port_that_has_no_next_port_is_chosen_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The system chooses the highest port for the first channel, so the second has no next port.

    Then the simulator lets the system choose again.
    """
    choices = iter([LARGEST])

    class Socket(socket.socket):
        def bind(self, address: Any) -> None:
            host, port = address
            super().bind((host, port or next(choices, 0)))

    monkeypatch.setattr(socket, "socket", Socket)
    sockets = open_sockets(2)
    first, second = (place(one.address)[1] for one in sockets)
    for one in sockets:
        one.close()
    assert second == first + 1 <= LARGEST


def test_a_port_that_is_taken_or_does_not_exist_is_one_sentence() -> None:
    """A UDP port is in use or impossible. The error message names the ports and says what to do."""
    with closing(open_sockets(1)[0]) as taken:
        number = place(taken.address)[1]
        with pytest.raises(OSError, match=rf"UDP port {number} \(Address already in use\)"):
            open_sockets(1, number)
        with pytest.raises(OSError, match=rf"UDP ports {number - 1} to {number} "):
            open_sockets(2, number - 1)
    with pytest.raises(OSError, match="choose 1 to 65534"):
        open_sockets(2, 65535)


def test_the_facts_add_what_became_of_the_lines() -> None:
    """The ``facts`` of a running board have the counts of dropped, lost and duplicated data.

    ``dropped`` counts bytes that the simulator could not send. ``lost`` and ``duplicated`` count
    datagrams that the simulated network has lost and duplicated.
    """
    with ServedBoard(ToyServer()) as served, served.lock:
        assert served.facts == {
            "x_m": 0.0,
            "y_m": 0.0,
            "yaw_rad": 0.0,
            "dropped": 0,
            "lost": 0,
            "duplicated": 0,
        }
