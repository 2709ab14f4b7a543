# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The threads around a session, on a real pseudo-terminal and without ROS."""

import contextlib
import ctypes
import fcntl
import itertools
import os
import select
import socket
import struct
import termios
import threading
import time
import tty
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path

import pytest
import serial
import serial.rfc2217
from listener import LAST_WORDS, PATIENCE_S, Listener, driver_threads, link_to, session
from terminal import fill

from omnibot_driver.core.errors import CommandRefused, LinkError
from omnibot_driver.core.events import Event, Notice
from omnibot_driver.core.kinematics import BodyTwist
from omnibot_driver.core.session import Session
from omnibot_driver.port import PEER_OPTIONS, Port
from omnibot_driver.simulator import BoardSettings, PtyBoard, SimulatedBoard
from omnibot_driver.standstill import SETTLE_S

STOP = bytes.fromhex("FF FE 02 00 00 00 00 00 00")


@pytest.fixture
def board() -> Iterator[PtyBoard]:
    with PtyBoard(SimulatedBoard(BoardSettings(running=True))) as board:
        yield board


@pytest.fixture(autouse=True)
def _nothing_is_left_behind() -> Iterator[None]:
    """Every link that a test opens gives its threads and descriptors back."""
    threads, descriptors = driver_threads(), os.listdir("/proc/self/fd")
    yield
    assert driver_threads() == threads
    assert len(os.listdir("/proc/self/fd")) == len(descriptors)


def test_measurements_are_delivered_on_the_reader_thread(board: PtyBoard) -> None:
    """No queue, no timer and no other thread stand between the wire and the listener."""
    listener = Listener()
    link = link_to(board.path, listener, session())
    link.start()
    listener.wait_for(lambda: len(listener.events) > 20)
    link.close("stop")
    assert listener.threads == {"omnibot-reader"}
    assert listener.reports == [None]


def test_a_repeated_command_and_its_timeout_need_nobody_elses_thread(board: PtyBoard) -> None:
    """The pacer repeats and stops, also while whoever commanded hangs."""
    listener, ours = Listener(), session()
    link = link_to(board.path, listener, ours)
    link.start()
    listener.wait_for(lambda: ours.state == "nominal")
    link.call(lambda s, now: s.command_twist(BodyTwist(0.3, 0.0, 0.0), now))
    assert board.wait_for(lambda b: [c.kind for c in b.commands].count("velocity") > 3, PATIENCE_S)
    assert board.wait_for(lambda b: b.commands[-1].kind == "wheels", PATIENCE_S)
    link.close("stop")


def test_the_figures_tell_of_the_port_and_its_bytes(board: PtyBoard, tmp_path: Path) -> None:
    """Why it cannot be had, how often it could, what went through it."""
    listener, name = Listener(), tmp_path / "board"
    link = link_to(str(name), listener, session())
    link.start()
    listener.wait_for(lambda: listener.reports)
    figures, _ = link.figures()
    assert (figures.port, figures.opened) == (str(name), 0)
    assert "does not exist" in figures.trouble
    name.symlink_to(board.path)
    listener.wait_for(lambda: len(listener.events) >= 50)
    figures, measured = link.figures()
    link.close("stop")
    assert (figures.trouble, figures.opened) == ("", 1)
    assert figures.received_bytes >= 14 * measured.tally.imu > 0
    assert figures.sent_bytes >= len(bytes(8) + STOP)


def test_closing_writes_stop_and_ends_the_threads(board: PtyBoard) -> None:
    """Also when it is closed twice."""
    listener, ours = Listener(), session()
    link = link_to(board.path, listener, ours)
    link.start()
    listener.wait_for(lambda: ours.state == "nominal")
    link.call(lambda s, now: s.command_twist(BodyTwist(0.3, 0.0, 0.0), now))
    link.close("stop")
    link.close("stop")
    assert board.wait_for(lambda b: bytes(b.received).endswith(STOP), PATIENCE_S)
    assert ours.state == "disconnected"


def test_every_read_and_every_write_can_be_listened_to(board: PtyBoard) -> None:
    """Byte for byte as they were, the opening and the farewell included."""
    read, written = [], []
    listener, ours = Listener(), session()
    link = link_to(board.path, listener, ours, on_read=read.append, on_write=written.append)
    link.start()
    listener.wait_for(lambda: len(listener.events) > 20)
    link.close("stop")
    assert written[-1] == STOP
    assert board.wait_for(lambda b: b.received == b"".join(written), PATIENCE_S)
    sent = b"".join(frame.data for frame in board.board.sent)
    assert len(read) > 10
    assert sent.startswith(b"".join(read))


def test_a_refused_command_raises_where_it_was_given(board: PtyBoard) -> None:
    """And the link goes on."""
    listener, ours = Listener(), session()
    link = link_to(board.path, listener, ours)
    link.start()
    listener.wait_for(lambda: ours.state == "nominal")
    with pytest.raises(CommandRefused):
        link.call(lambda s, now: s.command_twist(BodyTwist(float("nan"), 0.0, 0.0), now))
    link.call(lambda s, now: s.command_twist(BodyTwist(0.3, 0.0, 0.0), now))
    assert board.wait_for(lambda b: b.commands[-1].kind == "velocity", PATIENCE_S)
    link.close("stop")


def test_a_port_that_comes_late_is_opened(tmp_path: Path) -> None:
    """Closing works before, too."""
    listener, ours = Listener(), session()
    name = str(tmp_path / "omnibot")
    link = link_to(name, listener, ours)
    link.start()
    listener.wait_for(lambda: len(listener.reports) > 2)
    with PtyBoard(SimulatedBoard(), name):
        listener.wait_for(lambda: ours.state == "nominal")
        link.close("stop")
    never = link_to(name, Listener(), session())
    never.start()
    never.close("stop")


def test_attempts_are_made_less_and_less_often_up_to_a_limit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Each wait is half as long again as the one before; a limit keeps the board from waiting."""
    listener, times = Listener(), list[float]()
    listener.report = lambda _trouble: times.append(time.monotonic())  # type: ignore[method-assign]
    link = link_to("/no/such/port", listener, session())
    link.start()
    while len(times) < 6:
        time.sleep(0.01)
    link.close("stop")
    for number, (before, after) in enumerate(itertools.pairwise(times[:6])):
        assert after - before >= 0.02 * 1.5**number
    monkeypatch.setattr("omnibot_driver.link.LONGEST_WAIT_S", 0.0)
    listener = Listener()
    link = link_to("/no/such/port", listener, session())
    link.start()
    listener.wait_for(lambda: len(listener.reports) > 40)  # unlimited, that took days
    link.close("stop")


def test_a_board_plugged_in_under_another_name_is_found_and_stands_still(tmp_path: Path) -> None:
    """Behind the link that udev keeps; the command from before is forgotten."""
    name = tmp_path / "omnibot"
    listener, ours = Listener(), session()
    with PtyBoard(SimulatedBoard()) as second:
        with PtyBoard(SimulatedBoard(), str(name)) as first:
            link = link_to(str(name), listener, ours)
            link.start()
            listener.wait_for(lambda: ours.state == "nominal")
            link.call(lambda s, now: s.command_twist(BodyTwist(0.3, 0.0, 0.0), now))
            assert first.wait_for(lambda b: b.commands[-1].kind == "velocity", PATIENCE_S)
        listener.wait_for(lambda: ours.state == "disconnected")
        name.symlink_to(second.path)
        listener.wait_for(lambda: ours.state == "nominal")
        assert second.wait_for(lambda b: b.commands[-1].kind == "wheels", PATIENCE_S)
        with second.lock:
            assert "velocity" not in [command.kind for command in second.board.commands]
        link.call(lambda s, now: s.command_twist(BodyTwist(0.3, 0.0, 0.0), now))
        assert second.wait_for(lambda b: b.commands[-1].kind == "velocity", PATIENCE_S)
        link.close("stop")
        assert first.path != second.path


class Terminal:
    """A pseudo-terminal with nobody behind it who reads."""

    def __init__(self) -> None:
        self.far, self._near = os.openpty()
        tty.setraw(self._near)
        os.set_blocking(self._near, False)
        os.set_blocking(self.far, False)
        self.path = os.ttyname(self._near)

    def fill(self) -> None:
        """See ``terminal``."""
        fill(self._near)

    def read_until(self, words: bytes) -> bytes:
        """All that has been written, up to the time when these words are in it."""
        heard, end = b"", time.monotonic() + PATIENCE_S
        while words not in heard:
            assert select.select([self.far], [], [], end - time.monotonic())[0], heard
            heard += os.read(self.far, 4096)
        return heard

    def close(self) -> None:
        os.close(self.far)
        os.close(self._near)


@pytest.fixture
def terminal() -> Iterator[Terminal]:
    terminal = Terminal()
    yield terminal
    terminal.close()


def test_after_a_failed_write_the_opening_sequence_comes_before_anything_else(
    terminal: Terminal,
) -> None:
    """A board that hung may hold half a command; S, which found no room, is not what it needs.

    The first Stop is there before the port is opened anew: it may resume sooner.
    """
    listener = Listener()
    link = link_to(terminal.path, listener, session())
    link.start()
    terminal.read_until(STOP + b"S")
    terminal.fill()
    listener.wait_for(lambda: any("while writing" in str(text) for text in listener.reports))
    heard = terminal.read_until(STOP + b"S")
    assert heard.lstrip(b"x").startswith(2 * (bytes(8) + STOP) + b"S")
    link.close("stop")


def test_a_port_that_takes_no_farewell_is_left_to_the_guard(terminal: Terminal) -> None:
    """Closing does not hang; the robot is stopped as soon as the board listens again."""
    listener, ours = Listener(), session(run=False)
    link = link_to(terminal.path, listener, ours)
    link.start()
    terminal.read_until(STOP)
    terminal.fill()
    link.close("stop")
    terminal.read_until(LAST_WORDS)
    wait_for_threads_to_end()


def test_an_estop_that_a_full_port_does_not_take_is_known_to_be_late(terminal: Terminal) -> None:
    """Whoever pressed it is told; it is the first to be written once there is room."""
    listener, ours = Listener(), session(run=False)
    link = link_to(terminal.path, listener, ours)
    link.start()
    terminal.read_until(STOP)
    assert not link.blocked
    terminal.fill()
    link.call(lambda session, now: session.estop(True, now))
    assert link.blocked
    terminal.read_until(STOP + bytes.fromhex("FF FE 10 00 00 00 00 00 00"))
    link.close("stop")


def test_a_defect_while_the_port_is_full_leaves_the_stop_to_the_guard(terminal: Terminal) -> None:
    """The driver's own farewell finds no room; somebody has to say it."""
    listener, ours = Listener(), session(run=False)
    link = link_to(terminal.path, listener, ours)
    link.start()
    terminal.read_until(STOP)
    terminal.fill()

    closed, farewell_over = ours.closed, threading.Event()

    def defective(data: bytes, now: float) -> None:
        raise RuntimeError("a defect")

    def tell_and_close(now: float) -> None:
        farewell_over.set()
        closed(now)

    ours.hear, ours.closed = defective, tell_and_close  # type: ignore[method-assign]
    os.write(terminal.far, b"x")
    assert farewell_over.wait(PATIENCE_S)
    terminal.read_until(LAST_WORDS)
    link.close("stop")
    wait_for_threads_to_end()


def wait_for_threads_to_end() -> None:
    for thread in threading.enumerate():
        if thread.name.startswith("omnibot-"):
            thread.join(PATIENCE_S)


def test_a_port_that_no_guard_can_share_is_told_once(board: PtyBoard) -> None:
    """The driver is then the only one who can stop the robot."""
    listener = Listener()
    link = link_to("loop://", listener, session())
    link.start()
    listener.wait_for(lambda: listener.events)
    notices = [event.text for event in listener.events if isinstance(event, Notice)]
    link.close("stop")
    assert len(notices) == 1
    assert "guard" in notices[0]


def test_a_command_that_waited_while_the_watchdog_stood_still_is_refused(board: PtyBoard) -> None:
    """A deliverer that hangs keeps the pacer from passing; then no command is fresh."""
    listener, ours = Listener(), session()
    link = link_to(board.path, listener, ours)
    link.start()
    listener.wait_for(lambda: ours.state == "nominal")
    link.call(lambda s, now: s.command_twist(BodyTwist(0.3, 0.0, 0.0), now))
    drive = partial(link.command, lambda s, now: s.command_twist(BodyTwist(0.2, 0.0, 0.0), now))
    drive(time.time_ns())
    hold, held = threading.Event(), threading.Event()

    def hang(_session: Session, _now: float) -> None:
        held.set()
        hold.wait(PATIENCE_S)

    holder = threading.Thread(target=link.call, args=(hang,))
    holder.start()
    held.wait(PATIENCE_S)
    assert board.wait_for(lambda b: b.estopped, PATIENCE_S)
    sent_ns = time.time_ns()
    hold.set()
    holder.join(PATIENCE_S)
    with pytest.raises(CommandRefused, match="waited"):
        drive(sent_ns)
    listener.wait_for(lambda: any("stood still" in str(event) for event in listener.events))
    assert board.wait_for(lambda b: bytes(b.received).endswith(STOP), PATIENCE_S)
    fresh = time.monotonic() + SETTLE_S
    while time.monotonic() <= fresh:
        time.sleep(0.02)
    drive(time.time_ns())
    link.close("stop")


def test_an_unplugged_port_is_reported_and_ends_the_state() -> None:
    """The terminal hangs up."""
    listener, ours = Listener(), session()
    with PtyBoard(SimulatedBoard()) as board:
        link = link_to(board.path, listener, ours)
        link.start()
        listener.wait_for(lambda: ours.state == "nominal")
    listener.wait_for(lambda: ours.state == "disconnected" and len(listener.reports) > 1)
    link.close("stop")
    assert "lost" in str(listener.reports[1])


def test_a_listener_that_raises_ends_the_link_with_a_report(board: PtyBoard) -> None:
    """A thread never dies unheard, and the robot is stopped before the port is given back."""
    listener = Listener()

    def explode(events: Sequence[Event]) -> None:
        if events:
            raise ZeroDivisionError

    listener.deliver = explode  # type: ignore[method-assign]
    link = link_to(board.path, listener, session())
    link.start()
    listener.wait_for(lambda: listener.failures)
    assert board.wait_for(lambda b: bytes(b.received).endswith(STOP), PATIENCE_S)
    link.close("stop")
    assert isinstance(listener.failures[0], ZeroDivisionError)


@pytest.mark.parametrize(
    ("error", "advice"),
    [
        (PermissionError(13, "Permission denied"), "group dialout"),
        (FileNotFoundError(2, "No such file"), "by-id"),
        (BlockingIOError(11, "Resource temporarily unavailable"), "fuser"),
        (OSError(16, "Device or resource busy"), "fuser"),
        (ValueError("invalid URL"), "socket://"),
        (OSError(5, "Input/output error"), "check the parameter"),
    ],
)
def test_every_way_a_port_can_refuse_says_what_to_do(
    monkeypatch: pytest.MonkeyPatch, error: Exception, advice: str
) -> None:
    """Nobody can be refused as root, so the refusal is put in the library's mouth."""

    def refuse(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("serial.serial_for_url", refuse)
    with pytest.raises(LinkError, match=advice) as caught:
        Port("/dev/ttyUSB0", 115200)
    assert caught.value.__cause__ is error


def test_a_second_user_of_a_port_is_told_who_has_it(terminal: Terminal) -> None:
    """By the kernel's list of locks."""
    port = Port(terminal.path, 115200)
    with pytest.raises(LinkError, match=rf"in use by another program \(process {os.getpid()}, "):
        Port(terminal.path, 115200)
    port.close()


def test_closing_a_port_does_not_hang_up(terminal: Terminal) -> None:
    """DTR falling would restart a board that is wired to it."""
    Port(terminal.path, 115200).close()
    near = os.open(terminal.path, os.O_RDWR | os.O_NOCTTY)
    assert not termios.tcgetattr(near)[2] & termios.HUPCL
    os.close(near)


def test_a_real_terminal_is_exclusive_until_it_is_closed(
    terminal: Terminal, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Programs that ask for no lock are kept out as well; a pseudo-terminal stays as it is."""

    def exclusive() -> bool:
        near = os.open(terminal.path, os.O_RDWR | os.O_NOCTTY)  # as root, one may
        answer = fcntl.ioctl(near, TIOCGEXCL, bytes(4))
        os.close(near)
        return answer != bytes(4)

    port = Port(terminal.path, 115200)
    assert not exclusive()
    port.close()
    monkeypatch.setattr("omnibot_driver.port.PSEUDO_TERMINALS", ())
    port = Port(terminal.path, 115200)
    assert os.geteuid() != 0 or exclusive()
    port.close()
    assert not exclusive()


TIOCGEXCL = 0x80045440
"""Linux's ioctl for whether a terminal is exclusive; the termios module does not have it."""


def connected(server: socket.socket) -> tuple[Port, socket.socket]:
    """A port at this server, and the far end."""
    port = Port(f"socket://127.0.0.1:{server.getsockname()[1]}", 115200)
    return port, server.accept()[0]


@pytest.mark.parametrize("said", [STOP, b""], ids=["spoken to", "not spoken to"])
def test_a_peer_that_vanished_without_a_word_is_given_up(
    monkeypatch: pytest.MonkeyPatch, said: bytes
) -> None:
    """A half-open connection: nothing is acknowledged, nothing is refused."""
    options = {**PEER_OPTIONS, socket.TCP_USER_TIMEOUT: 300}
    monkeypatch.setattr("omnibot_driver.port.PEER_OPTIONS", options)
    with socket.create_server(("127.0.0.1", 0)) as server:
        port, far = connected(server)
        with far, closing(port):
            drop_everything(far)
            port.write(said)
            with pytest.raises(LinkError, match="lost"):
                go_on(port.read)


def go_on(action: Callable[[], object]) -> None:
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        action()


def drop_everything(peer: socket.socket) -> None:
    """Have the kernel throw away what comes in for this socket: a packet filter that says no."""
    program = ctypes.create_string_buffer(struct.pack("HBBI", 0x06, 0, 0, 0))
    so_attach_filter = 26
    peer.setsockopt(
        socket.SOL_SOCKET, so_attach_filter, struct.pack("HP", 1, ctypes.addressof(program))
    )


def test_a_peer_that_reads_nothing_ends_a_write_with_an_error() -> None:
    """Once the buffers on both sides are full."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        port, far = connected(server)
        with far, closing(port), pytest.raises(LinkError, match="while writing"):
            go_on(lambda: port.write(bytes(100_000)))


def test_after_a_failed_write_nothing_old_stands_in_the_way(terminal: Terminal) -> None:
    """What waited in the kernel is given up: a board that listens again hears the newest."""
    port = Port(terminal.path, 115200)
    terminal.fill()
    with pytest.raises(LinkError, match="while writing"):
        port.write(STOP)
    port.write(STOP)
    port.close()


def test_a_write_that_is_taken_in_pieces_is_completed(terminal: Terminal) -> None:
    """The kernel takes what there is room for, and the rest when somebody reads."""
    port = Port(terminal.path, 115200)
    message = b"".join(b"%05d" % number for number in range(8000))
    reader = threading.Thread(target=lambda: heard.append(terminal.read_until(b"07999")))
    heard: list[bytes] = []
    reader.start()
    port.write(message)
    reader.join(PATIENCE_S)
    assert heard == [message]
    port.close()


def test_a_board_behind_a_socket_is_served_as_well() -> None:
    """Any pyserial URL will do: ``socket://host:port`` reads and writes the same bytes."""
    server = socket.create_server(("127.0.0.1", 0))
    port = Port(f"socket://127.0.0.1:{server.getsockname()[1]}", 115200)
    far, _ = server.accept()
    far.sendall(b"Paused: 0 \n")
    received = b""
    while len(received) < 11:
        received += port.read()
    assert received == b"Paused: 0 \n"
    port.write(STOP)
    assert far.recv(100) == STOP
    far.close()
    with pytest.raises(LinkError, match="lost"):
        port.read()
    port.close()
    server.close()


@pytest.mark.filterwarnings("ignore:set(Daemon|Name)")  # pyserial 3.5
def test_a_board_behind_rfc2217_is_served_as_well() -> None:
    """A serial port server on the network, as pyserial's own example has it."""
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
    port = Port(f"rfc2217://127.0.0.1:{listener.getsockname()[1]}", 115200)
    port.write(b"Paused: 0 \n")
    received = b""
    while len(received) < 11:
        received += port.read()
    assert received == b"Paused: 0 \n"
    port.close()
    done.set()
    server.join(PATIENCE_S)
    listener.close()


class Connection:
    """What rfc2217's PortManager wants of a connection."""

    def __init__(self, client: socket.socket) -> None:
        self._client = client

    def write(self, data: bytes) -> None:
        self._client.sendall(data)
