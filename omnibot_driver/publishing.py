# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Publication of the session's events: measurements and states on topics, notices in the log.

`outbox.py` calls this module's methods one at a time, in the order of the events.
"""

import contextlib
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from nav_msgs.msg import Odometry
from rclpy._rclpy_pybind11 import RCLError
from rclpy.clock import ClockChange, JumpThreshold, TimeJump
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.task import Future
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Bool, String, UInt8MultiArray

from omnibot_driver import messages, selfcheck
from omnibot_driver.cdr import Messages, Serializer, difference
from omnibot_driver.core.events import Event, Extra, Notice, StateChanged
from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.core.odometry.estimate import OdometryEstimate
from omnibot_driver.core.packets import Packet
from omnibot_driver.core.readings import Unstamped
from omnibot_driver.core.requests import RequestDone
from omnibot_driver.core.session import Session
from omnibot_driver.core.traits import Traits
from omnibot_driver.qos import LATCHED
from omnibot_driver.transforms import transform_publisher

RAW_DEPTH: Final = 1000
"""Queue depth of the topics with raw bytes, so that a recorder that is delayed for seconds gets
every byte."""
UNHEARD: Final = ("disconnected", "connecting")
LATEST_NS: Final = (2**31 - 60) * 10**9
"""Time of a simulated clock, in ns, from which on measurements are not published. It is a minute
before the latest possible ROS stamp, because a stamp may be later than the clock."""


class Publishing:
    """The publisher of measurements, states and notices of one driver.

    The attribute ``settings`` applies to all messages. It may be replaced at any time.
    """

    def __init__(
        self,
        node: Node,
        session: Session,
        traits: Traits,
        values: Mapping[str, Any],
        settings: messages.MessageSettings,
    ) -> None:
        self._node, self._session = node, session
        self._maker: type[Serializer | Messages] = Serializer
        if strange := difference(settings):
            self._maker = Messages
            node.get_logger().warning(
                f"on this computer, rclpy serialises {strange} differently from the driver. So"
                " rclpy serialises the messages now, instead of the driver. This costs a little"
                " more processor time"
            )
        self.settings = settings
        self._port, self._channels = values["port"], traits.channels
        self._clock = node.get_clock()
        self._time_is_simulated = self._clock.ros_time_is_active
        self._time_watch = self._clock.create_jump_callback(
            JumpThreshold(min_forward=None, min_backward=None), post_callback=self._change_time
        )
        self._over = False
        node.context.on_shutdown(self._end)
        if traits.imu:
            self._imu = node.create_publisher(Imu, "imu/data_raw", 10)
        self._odometry = node.create_publisher(Odometry, "odom", 10)
        self._joints: Publisher | None = None
        if settings.wheels.joints:
            self._joints = node.create_publisher(JointState, "joint_states", 10)
        self._send_transform = transform_publisher(node) if values["publish_tf"] else None
        self._state = node.create_publisher(String, "~/state", LATCHED)
        self._estop_active = node.create_publisher(Bool, "~/estop_active", LATCHED)
        self._wheels = messages.unturned(settings.wheels)
        self._shown: StateChanged | None = None
        self._told: set[str] = set()
        self._clock_offset_ns = self._simulated_ns = 0
        self._stamped_ns: dict[type, int] = {}
        self._handlers: dict[type, Callable[[Any, int], None]] = {
            ImuEstimate: self._publish_imu,
            OdometryEstimate: self._publish_odometry,
            RequestDone: self._answer,
            Notice: self._warn,
            StateChanged: lambda event, _clock_offset_ns: self._show(event),
            Extra: self._publish_extra,
        }
        self.extras: Mapping[type, Callable[[Any, int], None]] = {}
        """Functions that publish the readings that only this board has, by the type of the reading.
        Each function receives a reading and its stamp in ns of ROS time."""

    @property
    def settings(self) -> messages.MessageSettings:
        """Settings of the messages, such as the names of coordinate frames."""
        return self._settings

    @settings.setter
    def settings(self, settings: messages.MessageSettings) -> None:
        self._settings, self._make = settings, self._maker(settings)

    def taps(self) -> dict[str, Callable[[Packet], None]]:
        """Return keyword arguments for ``Link`` that publish each read and write of the port."""
        return {
            "on_read": self._raw_publisher("~/raw_rx"),
            "on_write": self._raw_publisher("~/raw_tx"),
        }

    def deliver(self, events: Sequence[Event]) -> None:
        """Publish events now, and convert their stamps from the steady clock to ROS time."""
        if not events or self._over:
            return
        if self._time_is_simulated:
            self._deliver_simulated(events)
            return
        before_ns = time.monotonic_ns()
        wall_ns = time.time_ns()  # takes a tenth of the time of the node's clock
        offset_ns = self._clock_offset_ns = messages.clock_offset(
            self._clock_offset_ns, before_ns, wall_ns, time.monotonic_ns()
        )
        for event in events:
            self._handlers[type(event)](event, offset_ns)

    def publish(self, events: Sequence[Event], clock_offset_ns: int) -> None:
        """Publish events. ``clock_offset_ns`` is added to their stamps, which gives ROS time."""
        if self._over:
            return
        for event in events:
            self._handlers[type(event)](event, clock_offset_ns)

    def publish_state(self) -> None:
        """Publish the state at the driver's start, before the first event changes it."""
        self._show(StateChanged(*self._session.shown))

    def report_port(self, trouble: str | None) -> None:
        """Log that the port is open, or why it is not open.

        ``trouble``: the reason, as a sentence. None if the port is open.
        """
        if trouble is None:
            if self._is_news(text := f"port {self._port} is open"):
                self._node.get_logger().info(text)
            advice = selfcheck.latency_advice(self._port)
            if advice and self._is_news(advice):
                self._node.get_logger().warning(advice)
        elif self._is_news(trouble):
            self._node.get_logger().error(f"{trouble} (retrying)")

    def _deliver_simulated(self, events: Sequence[Event]) -> None:
        """Publish events with stamps of a simulated clock, which may jump back.

        While the clock shows 0, or a time too large for a ROS stamp, only events without a stamp
        are published.
        """
        now_ns = self._clock.now().nanoseconds
        if now_ns < self._simulated_ns:
            self._stamped_ns = {}
        self._simulated_ns = now_ns
        offset_ns = now_ns - time.monotonic_ns()
        for event in events:
            kind = type(event)
            extra = event.value if isinstance(event, Extra) else None
            stamped = isinstance(event, ImuEstimate | OdometryEstimate | Extra)
            if not stamped or isinstance(extra, RequestDone | Unstamped):
                self._handlers[kind](event, offset_ns)
            elif 0 < now_ns < LATEST_NS:
                steady_ns = round(event.stamp_s * 1e9)
                content = kind if extra is None else type(extra)
                stamp_ns = max(steady_ns + offset_ns, self._stamped_ns.get(content, 0) + 1)
                self._stamped_ns[content] = stamp_ns
                self._handlers[kind](event, stamp_ns - steady_ns)

    def _end(self) -> None:
        """Stop publishing, because ROS is shutting down. ROS calls this method."""
        self._over = True

    def _change_time(self, jump: TimeJump) -> None:
        """Record whether the node's time is simulated.

        ROS calls this method when the node changes to simulated time or back.
        """
        self._time_is_simulated = jump.clock_change == ClockChange.ROS_TIME_ACTIVATED

    def _raw_publisher(self, topic: str) -> Callable[[Packet], None]:
        """Return a function that publishes packets, those of each channel on a separate topic."""
        publishers = [
            self._node.create_publisher(UInt8MultiArray, f"{topic}/{name}".rstrip("/"), RAW_DEPTH)
            for name in self._channels
        ]

        def publish(packet: Packet) -> None:
            channel, data = packet
            with contextlib.suppress(RCLError):  # bytes are also sent after ROS has ended
                publishers[channel].publish(messages.raw_message(data))

        return publish

    def _publish_imu(self, estimate: ImuEstimate, clock_offset_ns: int) -> None:
        stamp_ns = round(estimate.stamp_s * 1e9) + clock_offset_ns
        self._imu.publish(self._make.imu(estimate, stamp_ns))

    def _publish_odometry(self, estimate: OdometryEstimate, clock_offset_ns: int) -> None:
        stamp_ns = round(estimate.stamp_s * 1e9) + clock_offset_ns
        self._odometry.publish(self._make.odometry(estimate, stamp_ns))
        if self._send_transform is not None:
            stamp = messages.time_message(stamp_ns)
            self._send_transform(messages.transform_message(estimate, stamp, self._settings))
        if self._joints is not None:
            self._wheels = messages.turned(self._wheels, estimate, self._settings.wheels)
            self._joints.publish(self._make.joint_state(self._wheels, stamp_ns))

    def _publish_extra(self, extra: Extra, clock_offset_ns: int) -> None:
        stamp_ns = round(extra.stamp_s * 1e9) + clock_offset_ns
        self.extras[type(extra.value)](extra.value, stamp_ns)

    def _answer(self, done: RequestDone, _clock_offset_ns: int) -> None:
        assert isinstance(done.token, Future)
        done.token.set_result(done)
        if self._node.executor is not None:
            self._node.executor.wake()

    def _show(self, now: StateChanged) -> None:
        state, before = now.state, self._shown
        self._shown = now
        if before is None or state != before.state:
            if state not in UNHEARD:
                self._told = set()
            if self._is_news(text := f"state: {state}"):
                self._node.get_logger().info(text)
            self._state.publish(String(data=state))
        if before is None or now.estop_active != before.estop_active:
            self._estop_active.publish(Bool(data=now.estop_active))

    def _warn(self, notice: Notice, _clock_offset_ns: int) -> None:
        self._node.get_logger().warning(notice.text)

    def _is_news(self, text: str) -> bool:
        """Return whether this text is new, and record the text as logged.

        A change of state makes all texts new again, except a change to the state disconnected or
        connecting.
        """
        told, self._told = self._told, self._told | {text}
        return text not in told
