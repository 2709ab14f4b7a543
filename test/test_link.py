"""The threads around a session, on a real pseudo-terminal and without ROS."""

import contextlib
import os
import socket
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
import serial
import serial.rfc2217

from omnibot_driver.core.commands import CommandSettings
from omnibot_driver.core.errors import CommandRefused, LinkError
from omnibot_driver.core.kinematics import BodyTwist
from omnibot_driver.core.limits import SpeedLimits
from omnibot_driver.core.odometry import OdometrySettings
from omnibot_driver.core.omnibot import OmniBot, OmniBotSettings
from omnibot_driver.core.session import Event, ImuEstimate, Session, SessionSettings
from omnibot_driver.link import Link
from omnibot_driver.port import Port
from omnibot_driver.simulator import BoardSettings, PtyBoard, SimulatedBoard

PATIENCE_S = 20.0
STOP = bytes.fromhex("FF FE 02 00 00 00 00 00 00")
LAST_WORDS = bytes(8) + STOP + bytes.fromhex("FF FE 10 00 00 00 00 00 00")


class Listener:
    """Keeps what a link delivers and reports, and wakes who waits for it."""

    def __init__(self) -> None:
        self.events: list[Event] = []
        self.reports: list[str | None] = []
        self.failures: list[BaseException] = []
        self.threads: set[str] = set()
        self._changed = threading.Condition()

    def deliver(self, events: Sequence[Event]) -> None:
        with self._changed:
            self.events += events
            if any(isinstance(event, ImuEstimate) for event in events):
                self.threads.add(threading.current_thread().name)
            self._changed.notify_all()

    def report(self, trouble: str | None) -> None:
        with self._changed:
            self.reports.append(trouble)
            self._changed.notify_all()

    def failed(self, error: BaseException) -> None:
        with self._changed:
            self.failures.append(error)
            self._changed.notify_all()

    def wait_for(self, predicate: object) -> None:
        assert callable(predicate)
        with self._changed:
            assert self._changed.wait_for(predicate, PATIENCE_S)


def session() -> Session:
    settings = SessionSettings(
        limits=SpeedLimits(), commands=CommandSettings(), odometry=OdometrySettings()
    )
    return Session(OmniBot(OmniBotSettings()), settings, run=True)


def link_to(url: str, listener: Listener, session: Session) -> Link:
    return Link(
        session,
        url,
        115200,
        last_words=LAST_WORDS,
        reconnect_interval_s=0.02,
        deliver=listener.deliver,
        report=listener.report,
        failed=listener.failed,
    )


@pytest.fixture
def board() -> Iterator[PtyBoard]:
    with PtyBoard(SimulatedBoard(BoardSettings(running=True))) as board:
        yield board


@pytest.fixture(autouse=True)
def _nothing_is_left_behind() -> Iterator[None]:
    """Every link that a test opens gives its threads and descriptors back."""
    threads, descriptors = threading.active_count(), os.listdir("/proc/self/fd")
    yield
    assert threading.active_count() == threads
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
