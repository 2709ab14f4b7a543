# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A ROS node through which the tests observe and command one driver."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial, partialmethod
from typing import TYPE_CHECKING, Any, Self

import rclpy
from driver_process import PATIENCE_S, Driver
from geometry_msgs.msg import Twist
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.exceptions import InvalidHandle
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from rclpy.time import Time
from std_msgs.msg import String

from omnibot_driver.node import WARN_EVERY_S
from omnibot_driver.stall_detector import SETTLE_S

if TYPE_CHECKING:
    import pytest

ANSWER_LOST = "client will not receive response"
"""Words in the driver's output when the middleware has dropped an answer of a service."""
NO_EVENTS = SubscriptionEventCallbacks(use_default_callbacks=False)
NO_PUBLISHER_EVENTS = PublisherEventCallbacks(use_default_callbacks=False)
"""Options that turn off the middleware's events of subscriptions and publishers.

A node needs more processor time to wait for these events than to receive its messages.
"""


def leave_events_out(patch: "pytest.MonkeyPatch") -> None:
    """Turn off the events of the middleware in all nodes of this process.

    The events would take about a tenth of the processor time of a calibration.
    """
    for name, events in (
        ("create_subscription", NO_EVENTS),
        ("create_publisher", NO_PUBLISHER_EVENTS),
    ):
        patch.setattr(Node, name, partialmethod(getattr(Node, name), event_callbacks=events))


@contextmanager
def ros() -> Iterator[None]:
    """Set up ROS, and keep one node until the end of the tests.

    The node keeps the middleware's participant alive: Fast DDS has crashed when the end of a probe
    deleted the participant.
    """
    rclpy.init()
    node = Node("tests", enable_rosout=False, start_parameter_services=False)
    try:
        yield
    finally:
        node.destroy_node()
        rclpy.shutdown()


class Probe:
    """A ROS node in the namespace of a driver. It subscribes, publishes and calls services."""

    def __init__(self, namespace: str) -> None:
        self.node = Node("probe", namespace=namespace, start_parameter_services=False)
        self._received: dict[str, list[Any]] = {}
        self._clients: dict[str, Any] = {}
        self._answers: list[Answer] = []
        self._changed = threading.Condition()
        self._publish_again: Callable[[], None] = lambda: None
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._stopping = Future()
        self._spinner = threading.Thread(
            target=self._executor.spin_until_future_complete, args=(self._stopping,)
        )

    @classmethod
    def of(cls, driver: Driver) -> Self:
        """Return a probe of a driver. The probe calls a service again if the answer is lost."""
        probe = cls(driver.namespace)
        driver.answers[ANSWER_LOST] = probe.call_again
        return probe

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
        """Subscribe to a topic, and return the list to which its messages are appended."""
        messages = self._received.setdefault(topic, [])
        qos = QoSProfile(depth=1000)
        if latched:
            qos.durability = DurabilityPolicy.TRANSIENT_LOCAL

        def append(message: Any) -> None:
            with self._changed:
                messages.append(message)
                self._changed.notify_all()

        self.node.create_subscription(kind, topic, append, qos, event_callbacks=NO_EVENTS)
        self._executor.wake()
        return messages

    def listen_raw(
        self, kind: type, topic: str, qos: QoSProfile, append: Callable[[bytes, Any], None]
    ) -> None:
        """Subscribe to a topic. Pass each serialised message and its message info to ``append``."""

        def take(data: bytes, info: Any) -> None:
            with self._changed:
                append(data, info)
                self._changed.notify_all()

        self.node.create_subscription(kind, topic, take, qos, raw=True, event_callbacks=NO_EVENTS)
        self._executor.wake()

    def wait_for(self, predicate: Callable[[], object]) -> None:
        """Wait until the predicate holds. The probe checks it whenever a message arrives."""
        assert self.comes_about(predicate), "the condition did not become true in time"

    def comes_about(self, predicate: Callable[[], object]) -> bool:
        """Wait for the predicate, and return whether it holds within ``PATIENCE_S``."""
        with self._changed:
            return bool(self._changed.wait_for(predicate, PATIENCE_S))

    def wait_for_later_stamp(self, messages: list[Any]) -> None:
        """Wait until the newest message has a timestamp more than 1 s after the call.

        Messages with earlier timestamps may still arrive after the call.
        """
        then_ns = self.node.get_clock().now().nanoseconds + 10**9
        self.wait_for(
            lambda: messages and Time.from_msg(messages[-1].header.stamp).nanoseconds > then_ns
        )

    def wait_for_state(self, state: str) -> None:
        if "omnibot_driver/state" not in self._received:
            self.listen(String, "omnibot_driver/state", latched=True)
        states = self._received["omnibot_driver/state"]
        self.wait_for(lambda: states and states[-1].data == state)

    def publisher(self, kind: type, topic: str, qos: QoSProfile | int = 1) -> Any:
        """Create a publisher, and wait until it has a subscriber."""
        publisher = self.node.create_publisher(
            kind, topic, qos, event_callbacks=NO_PUBLISHER_EVENTS
        )
        self.wait_for_graph(publisher.get_subscription_count)
        publish = publisher.publish

        def keep_and_publish(message: Any) -> None:
            self._publish_again = partial(publish, message)
            publish(message)

        publisher.publish = keep_and_publish
        return publisher

    def publish_again(self) -> None:
        """Publish the probe's newest message again some seconds later, when any stall is over.

        The wait is longer than ``WARN_EVERY_S``. So if the driver refuses the message again, it
        logs that.
        """

        def publish() -> None:
            with suppress(InvalidHandle):  # the test has ended or removed its publisher
                self._publish_again()

        threading.Timer(WARN_EVERY_S + 2 * SETTLE_S, publish).start()

    def forget_message(self) -> None:
        """Forget the newest message, so that ``publish_again`` does nothing.

        The test has already repeated this message until it was obeyed.
        """
        self._publish_again = lambda: None

    def call_again(self) -> None:
        """Repeat the calls that have no answer yet.

        The middleware drops an answer if the driver needs more than 0.1 s to discover the new
        client.
        """
        for answer in self._answers:
            if not answer.arrived:
                with suppress(InvalidHandle):  # the test has ended
                    answer.call()

    @contextmanager
    def commanding(self, vx: float, yaw_rate: float = 0.0) -> Iterator[None]:
        """Publish a velocity (m/s, rad/s) on ``cmd_vel`` at 10 Hz within a ``with`` statement."""
        publisher = self.publisher(Twist, "cmd_vel")
        twist = Twist()
        twist.linear.x, twist.angular.z = vx, yaw_rate
        timer = self.node.create_timer(0.1, lambda: publisher.publish(twist))
        try:
            yield
        finally:
            self.remove(timer)
            self.forget_message()

    def wait_for_graph(self, predicate: Callable[[], object]) -> None:
        """Wait until the predicate holds. The probe checks it every 20 ms."""
        held = threading.Event()

        def look() -> None:
            if predicate():
                held.set()

        timer = self.node.create_timer(0.02, look)
        self._executor.wake()
        assert held.wait(PATIENCE_S), "the ROS graph did not reach the expected state"
        self.remove(timer)

    def wait_for_node(self, name: str, namespace: str) -> None:
        """Wait until the node is discovered. Its topics may be discovered earlier."""
        self.wait_for_graph(lambda: (name, namespace) in self.node.get_node_names_and_namespaces())

    def remove(self, entity: Any) -> None:
        """Destroy a publisher, client or timer while the executor does not wait for it."""
        destroy = getattr(self.node, f"destroy_{type(entity).__name__.lower()}")
        self.wait_for_future(self._executor.create_task(destroy, entity))

    def client(self, kind: type, service: str) -> Any:
        """Return the client of a service. Each client is created only once.

        The middleware would keep a destroyed client in memory.
        """
        if service not in self._clients:
            self._clients[service] = self.node.create_client(
                kind, f"omnibot_driver/{service}", qos_profile=QoSProfile(depth=1000)
            )
            self._executor.wake()
        client = self._clients[service]
        assert client.wait_for_service(PATIENCE_S), f"no service {service}"
        return client

    def call_async(self, kind: type, service: str, **request: object) -> "Answer":
        answer = Answer(self.client(kind, service), kind.Request(**request))  # type: ignore[attr-defined]
        self._answers.append(answer)
        answer.call()
        return answer

    def wait_for_future(self, future: Any) -> None:
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        assert done.wait(PATIENCE_S), "no answer"

    def call(self, kind: type, service: str, **request: object) -> Any:
        """Call a service and return its answer.

        If a stall of the driver ends the requested task, the call is repeated.
        """
        for _ in range(20):
            answer = self.call_async(kind, service, **request).wait()
            if "the driver stalled meanwhile" not in getattr(answer, "message", ""):
                break
        return answer


class Answer:
    """A service call in progress."""

    def __init__(self, client: Any, request: Any) -> None:
        self._client, self._request = client, request
        self._done = threading.Event()
        self._answer: Any = None

    def call(self) -> None:
        """Send the request."""
        self._client.call_async(self._request).add_done_callback(self._arrive)

    def _arrive(self, future: Any) -> None:
        self._answer = future.result()
        self._done.set()

    @property
    def arrived(self) -> bool:
        return self._done.is_set()

    def wait(self) -> Any:
        assert self._done.wait(PATIENCE_S), "no answer"
        return self._answer
