"""Real driver processes, a real pseudo-terminal, real DDS: what the system tests stand on."""

import itertools
import os
import re
import signal
import subprocess
import sys
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any, Self

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from std_msgs.msg import String

from omnibot_driver.simulator import BoardSettings, PtyBoard, SimulatedBoard

PATIENCE_S = 20.0
"""How long an event is awaited before a test gives up; nobody asserts how long it took."""

_namespaces = (f"robot{number}" for number in itertools.count())


class Driver:
    """``python -m omnibot_driver.driver`` as a process of its own, in a namespace of its own."""

    def __init__(self, *, port: str, **parameters: object) -> None:
        self.namespace = next(_namespaces)
        arguments = ["--ros-args", "-r", f"__ns:=/{self.namespace}"]
        for name, value in {"port": port, **parameters}.items():
            arguments += ["-p", f"{name}:={value}"]
        self.process = subprocess.Popen(
            [sys.executable, "-m", "omnibot_driver.driver", *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env={**os.environ, "PYTHONUNBUFFERED": "1", "RCUTILS_LOGGING_USE_STDOUT": "1"},
        )
        self.lines: list[str] = []
        self._said = threading.Condition()
        self._listener = threading.Thread(target=self._listen)
        self._listener.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(PATIENCE_S)
        finally:
            self.process.kill()
            self._listener.join()
            assert self.process.stdout is not None
            self.process.stdout.close()

    @property
    def output(self) -> str:
        return "".join(self.lines)

    def wait_for_line(self, pattern: str) -> str:
        """The first line of the output in which the pattern is found."""

        def find() -> str | None:
            return next((line for line in self.lines if re.search(pattern, line)), None)

        with self._said:
            if not self._said.wait_for(lambda: find() or self._ended(), PATIENCE_S):
                raise AssertionError(f"no line matches {pattern!r} in:\n{self.output}")
            line = find()
        assert line is not None, f"the driver ended without {pattern!r}:\n{self.output}"
        return line

    def end(self, *signals: signal.Signals) -> int:
        """Send the signals, one after the other, and return the exit code."""
        for number in signals:
            self.process.send_signal(number)
        return self.process.wait(PATIENCE_S)

    def _ended(self) -> bool:
        return not self._listener.is_alive()

    def _listen(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            with self._said:
                self.lines.append(line)
                self._said.notify_all()
        with self._said:
            self._said.notify_all()


class Probe:
    """Another ROS process's view of one driver: subscribes, publishes and calls."""

    def __init__(self, namespace: str) -> None:
        self.node = Node("probe", namespace=namespace)
        self._received: dict[str, list[Any]] = {}
        self._changed = threading.Condition()
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._stopping = Future()
        self._spinner = threading.Thread(
            target=self._executor.spin_until_future_complete, args=(self._stopping,)
        )

    def __enter__(self) -> Self:
        self._spinner.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopping.set_result(None)
        self._executor.wake()
        self._spinner.join()
        self._executor.shutdown()
        self.node.destroy_node()

    def listen(self, kind: type, topic: str, *, latched: bool = False) -> list[Any]:
        """The list that messages of this topic are appended to as they come."""
        messages = self._received.setdefault(topic, [])
        qos = QoSProfile(depth=1000)
        if latched:
            qos.durability = DurabilityPolicy.TRANSIENT_LOCAL

        def append(message: Any) -> None:
            with self._changed:
                messages.append(message)
                self._changed.notify_all()

        self.node.create_subscription(kind, topic, append, qos)
        self._executor.wake()
        return messages

    def wait_for(self, predicate: Callable[[], object]) -> None:
        """Until the predicate holds; it is asked again whenever a message comes in."""
        with self._changed:
            assert self._changed.wait_for(predicate, PATIENCE_S), "it did not come about"

    def wait_for_state(self, state: str) -> None:
        if "omnibot_driver/state" not in self._received:
            self.listen(String, "omnibot_driver/state", latched=True)
        states = self._received["omnibot_driver/state"]
        self.wait_for(lambda: states and states[-1].data == state)

    def publisher(self, kind: type, topic: str) -> Any:
        """A publisher that the driver already listens to."""
        publisher = self.node.create_publisher(kind, topic, 1)
        matched = threading.Event()

        def look() -> None:
            if publisher.get_subscription_count():
                matched.set()

        timer = self.node.create_timer(0.02, look)
        self._executor.wake()
        assert matched.wait(PATIENCE_S), f"nobody subscribes {topic}"
        self.node.destroy_timer(timer)
        return publisher

    def client(self, kind: type, service: str) -> Any:
        client = self.node.create_client(kind, f"omnibot_driver/{service}")
        self._executor.wake()
        assert client.wait_for_service(PATIENCE_S), f"nobody offers {service}"
        return client

    def call_async(self, kind: type, service: str, **request: object) -> "Answer":
        return Answer(self.client(kind, service), kind.Request(**request))  # type: ignore[attr-defined]

    def wait_for_future(self, future: Any) -> None:
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        assert done.wait(PATIENCE_S), "no answer"

    def call(self, kind: type, service: str, **request: object) -> Any:
        return self.call_async(kind, service, **request).wait()


class Answer:
    """A service call under way."""

    def __init__(self, client: Any, request: Any) -> None:
        self._done = threading.Event()
        self._future = client.call_async(request)
        self._future.add_done_callback(lambda _: self._done.set())

    @property
    def arrived(self) -> bool:
        return self._done.is_set()

    def wait(self) -> Any:
        assert self._done.wait(PATIENCE_S), "no answer"
        return self._future.result()


@pytest.fixture(scope="session", autouse=True)
def _ros() -> Iterator[None]:
    rclpy.init()
    yield
    rclpy.shutdown()


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    """Whatever a test enters here ends with it, in reverse order."""
    with ExitStack() as stack:
        yield stack


@pytest.fixture
def start_board(stack: ExitStack) -> Callable[..., PtyBoard]:
    def start(*, link: str | None = None, **settings: Any) -> PtyBoard:
        return stack.enter_context(PtyBoard(SimulatedBoard(BoardSettings(**settings)), link))

    return start


@pytest.fixture
def start_driver(stack: ExitStack) -> Callable[..., Driver]:
    def start(port: str, **parameters: object) -> Driver:
        return stack.enter_context(Driver(port=port, **parameters))

    return start


@pytest.fixture
def probe_of(stack: ExitStack) -> Callable[[Driver], Probe]:
    return lambda driver: stack.enter_context(Probe(driver.namespace))


@pytest.fixture
def board(start_board: Callable[..., PtyBoard]) -> PtyBoard:
    return start_board()


@pytest.fixture
def driver(board: PtyBoard, start_driver: Callable[..., Driver]) -> Driver:
    return start_driver(board.path)


@pytest.fixture
def probe(driver: Driver, probe_of: Callable[[Driver], Probe]) -> Probe:
    probe = probe_of(driver)
    probe.wait_for_state("nominal")
    return probe


@pytest.fixture
def silent_terminal() -> Iterator[tuple[int, str]]:
    """A pseudo-terminal with nobody behind it: the descriptor of its far end, and its name."""
    far, near = os.openpty()
    tty.setraw(near)
    yield far, os.ttyname(near)
    os.close(far)
    os.close(near)


@pytest.fixture
def silent_port(silent_terminal: tuple[int, str]) -> str:
    return silent_terminal[1]


@pytest.fixture
def write_to_silent_port(silent_terminal: tuple[int, str]) -> Callable[[bytes], None]:
    """Writes everything, however slowly it is read."""

    def write(data: bytes) -> None:
        while data:
            data = data[os.write(silent_terminal[0], data[:1024]) :]

    return write
