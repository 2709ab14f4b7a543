"""The node: topics, services and parameters wired to a link and its session.

Nothing is computed here. Measurements are published by the link's reader thread as they come;
the executor sleeps unless a message, a service call or a parameter wakes it.
"""

import contextlib
import math
import re
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import rclpy
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy._rclpy_pybind11 import RCLError
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Bool, Float32MultiArray, String, UInt8MultiArray
from std_srvs.srv import SetBool, Trigger

from omnibot_driver import calibration, messages, parameters, selfcheck
from omnibot_driver.core.diagnosis import Refusals
from omnibot_driver.core.errors import CommandRefused, ParameterError, RequestRefused
from omnibot_driver.core.inertial import ImuEstimate
from omnibot_driver.core.odometry import OdometryEstimate
from omnibot_driver.core.omnibot import OmniBot
from omnibot_driver.core.session import (
    Event,
    Notice,
    RequestDone,
    Session,
    StateChanged,
)
from omnibot_driver.core.supervisor import Request
from omnibot_driver.diagnostics import Diagnostics
from omnibot_driver.link import Link
from omnibot_driver.recording import is_recording, open_recording
from omnibot_driver.replay import Replay
from omnibot_driver.transforms import transform_publisher

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
RAW_DEPTH = 1000
"""A recorder that is kept waiting for seconds still gets every byte."""
LOOK_EVERY_S = WARN_EVERY_S = 2.0
UNHEARD = ("disconnected", "connecting")
MessageInfo = dict[str, int]
NOT_OURS = re.compile(r"use_sim_time|start_type_description_service|qos_overrides\..+")
"""Parameters that rclpy itself declares for every node."""


class OmniBotDriver(Node):
    """The driver node. Raises ParameterError when it cannot start with the given parameters."""

    def __init__(
        self, *, end: Callable[[BaseException | None], object] = lambda _error: None
    ) -> None:
        super().__init__("omnibot_driver")
        self._end = end
        self._values = self._declare_parameters()
        self._message_settings = messages.MessageSettings.from_parameters(self._values)
        self._board = OmniBot(parameters.board_settings(self._values))
        self._session = Session(
            self._board,
            parameters.session_settings(self._values),
            run=self._values["auto_start"],
            axis_signs=tuple(self._values["axis_signs"]),
            control=self._values["control_method"],
            obeys=not is_recording(self._values["port"]),
        )
        self._state_lock = threading.Lock()
        self._told: set[str] = set()
        self._refused_at_s: dict[str, float] = {}
        self._refusals = Refusals()
        self._clock_offset_ns = 0
        self._handlers: dict[type, Callable[[Any, int], None]] = {
            ImuEstimate: self._publish_imu,
            OdometryEstimate: self._publish_odometry,
            RequestDone: self._answer,
            Notice: self._warn,
            StateChanged: lambda _event, _clock_offset_ns: self._publish_state(),
        }
        self._link = self._make_link()
        self._create_publishers()
        self._create_inputs()
        port = self._values["port"]
        if isinstance(self._link, Link):  # a recording is no link to be judged
            self._diagnostics = Diagnostics(self, self._link, lambda: self._refusals, port)
        if advice := selfcheck.clock_advice(port, self.get_parameter("use_sim_time").value):
            self.get_logger().warning(advice)
        self._publish_state()
        self._link.start()

    def _make_link(self) -> Link | Replay:
        port = self._values["port"]
        if is_recording(port):
            return Replay(
                self._session,
                open_recording(port),
                deliver=self._publish,
                report=self._report_port,
                failed=self.report_defect,
            )
        return Link(
            self._session,
            port,
            self._values["baudrate"],
            last_words=(self._board.wake() + self._board.emergency_stop())
            if self._values["guard"]
            else None,
            reconnect_interval_s=self._values["reconnect_interval"],
            deliver=self._deliver,
            report=self._report_port,
            failed=self.report_defect,
            **self._taps(),
        )

    def close(self) -> None:
        """Stop the robot and give the port back; ROS entities live on until ``destroy_node``."""
        self._link.close(self._values["on_exit"])

    def report_defect(self, error: BaseException) -> None:
        """Something that must not happen has; say so and have the driver end."""
        if isinstance(error, RCLError) and not self.context.ok():
            self._end(None)  # ROS was shut down under our hands
            return
        trace = "".join(traceback.format_exception(error))
        self.get_logger().fatal(
            f"stopping after a defect of the driver, please report it:\n{trace}"
        )
        self._end(error)

    # Parameters

    def _declare_parameters(self) -> dict[str, Any]:
        given = {
            name: override.value
            for name, override in self._parameter_overrides.items()
            if not NOT_OURS.fullmatch(name)
        }
        values = parameters.check_all(given)
        if file := values["calibration_file"]:
            values = parameters.check_all({**given, **calibration.load(Path(file).expanduser())})
        for parameter in parameters.PARAMETERS:
            self.declare_parameter(
                parameter.name,
                values[parameter.name],
                _descriptor(parameter),
                ignore_override=True,
            )
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._apply_parameters)
        return values

    def _check_parameters(self, changed: list[rclpy.Parameter]) -> SetParametersResult:
        try:
            for parameter in changed:
                if parameter.name in parameters.BY_NAME:
                    parameters.BY_NAME[parameter.name].check(parameter.value)
        except ParameterError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply_parameters(self, changed: list[rclpy.Parameter]) -> None:
        ours = {item.name: item.value for item in changed if item.name in parameters.BY_NAME}
        self._values = parameters.check_all({**self._values, **ours})
        self._message_settings = messages.MessageSettings.from_parameters(self._values)
        self._board.settings = parameters.board_settings(self._values)
        self._link.reconnect_interval_s = self._values["reconnect_interval"]
        settings = parameters.session_settings(self._values)
        self._link.call(lambda session, _now: session.configure(settings))

    # From the board to ROS

    def _create_publishers(self) -> None:
        self._imu = self.create_publisher(Imu, "imu/data_raw", 10)
        self._odometry = self.create_publisher(Odometry, "odom", 10)
        self._joints = self.create_publisher(JointState, "joint_states", 10)
        self._send_transform = transform_publisher(self) if self._values["publish_tf"] else None
        self._state = self.create_publisher(String, "~/state", LATCHED)
        self._estop_active = self.create_publisher(Bool, "~/estop_active", LATCHED)
        self._published: tuple[str, bool] | None = None

    def _taps(self) -> dict[str, Callable[[bytes], None]]:
        """What a link says of the wire itself, where that is wanted."""
        if not self._values["publish_raw"]:
            return {}

        def publishing(topic: str) -> Callable[[bytes], None]:
            publisher = self.create_publisher(UInt8MultiArray, topic, RAW_DEPTH)

            def publish(data: bytes) -> None:
                with contextlib.suppress(RCLError):  # the last words outlive ROS
                    publisher.publish(messages.raw_message(data))

            return publish

        return {"on_read": publishing("~/raw_rx"), "on_write": publishing("~/raw_tx")}

    def _deliver(self, events: Sequence[Event]) -> None:
        if not events or not self.context.ok():
            return
        before_ns = time.monotonic_ns()
        wall_ns = self.get_clock().now().nanoseconds
        self._clock_offset_ns = messages.clock_offset(
            self._clock_offset_ns, before_ns, wall_ns, time.monotonic_ns()
        )
        self._publish(events, self._clock_offset_ns)

    def _publish(self, events: Sequence[Event], clock_offset_ns: int) -> None:
        if not self.context.ok():
            return
        for event in events:
            self._handlers[type(event)](event, clock_offset_ns)

    def _publish_imu(self, estimate: ImuEstimate, clock_offset_ns: int) -> None:
        stamp = messages.time_message(round(estimate.stamp_s * 1e9) + clock_offset_ns)
        self._imu.publish(messages.imu_message(estimate, stamp, self._message_settings))

    def _publish_odometry(self, estimate: OdometryEstimate, clock_offset_ns: int) -> None:
        stamp = messages.time_message(round(estimate.stamp_s * 1e9) + clock_offset_ns)
        odometry = messages.odometry_message(estimate, stamp, self._message_settings)
        self._odometry.publish(odometry)
        if self._send_transform is not None:
            self._send_transform(messages.transform_message(odometry))
        self._joints.publish(messages.joint_state_message(estimate, stamp, self._message_settings))

    def _publish_state(self) -> None:
        """Latched topics show what is so now, whichever thread says so last."""
        with self._state_lock:
            now = (self._session.state, self._session.estop_active)
            before = self._published or (None, None)
            self._published = now
            if now[0] != before[0]:
                if now[0] not in UNHEARD:
                    self._told = set()
                if self._is_news(state := f"state: {now[0]}"):
                    self.get_logger().info(state)
                self._state.publish(String(data=now[0]))
            if now[1] != before[1]:
                self._estop_active.publish(Bool(data=now[1]))

    def _answer(self, done: RequestDone, _clock_offset_ns: int) -> None:
        assert isinstance(done.token, Future)
        done.token.set_result(done)
        if self.executor is not None:
            self.executor.wake()

    def _warn(self, notice: Notice, _clock_offset_ns: int) -> None:
        self.get_logger().warning(notice.text)

    def _report_port(self, trouble: str | None) -> None:
        if trouble is None:
            if self._is_news(text := f"port {self._values['port']} is open"):
                self.get_logger().info(text)
            advice = selfcheck.latency_advice(self._values["port"])
            if advice and self._is_news(advice):
                self.get_logger().warning(advice)
        elif self._is_news(trouble):
            self.get_logger().error(f"{trouble} (retrying)")

    def _is_news(self, text: str) -> bool:
        """Each thing once until the board is understood again: a port that flaps is no news."""
        told, self._told = self._told, self._told | {text}
        return text not in told

    # From ROS to the board

    def _create_inputs(self) -> None:
        if self._values["enable_stamped_cmd_vel"]:
            self.create_subscription(TwistStamped, "cmd_vel", self._on_twist_stamped, 1)
        else:
            self.create_subscription(Twist, "cmd_vel", self._on_twist, 1)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._looking = self.create_timer(LOOK_EVERY_S, self._look_for_other_types, clock=steady)
        self.create_subscription(Float32MultiArray, "wheel_cmd", self._on_wheels, 1)
        self.create_subscription(PoseStamped, "cmd_pose", self._on_pose, 1)
        self.create_subscription(Bool, "estop", self._on_estop_topic, 10)
        self.create_service(SetBool, "~/estop", self._on_estop)
        self.create_service(Trigger, "~/reset_odometry", self._on_reset_odometry)
        waiting = ReentrantCallbackGroup()
        self.create_service(Trigger, "~/start", self._on_start, callback_group=waiting)
        self.create_service(SetBool, "~/pause", self._on_pause, callback_group=waiting)
        self.create_service(Trigger, "~/reset", self._on_reset, callback_group=waiting)
        self.create_service(
            Trigger, "~/calibrate_gyro", self._on_calibrate_gyro, callback_group=waiting
        )

    def _on_twist(self, twist: Twist, info: MessageInfo) -> None:
        self._command(
            lambda session, now: session.command_twist(messages.body_twist(twist), now), info
        )

    def _on_twist_stamped(self, stamped: TwistStamped, info: MessageInfo) -> None:
        age_s = messages.age(stamped.header.stamp, self.get_clock().now().nanoseconds)
        self._command(
            lambda session, now: session.command_twist(
                messages.body_twist(stamped.twist), now, age_s=age_s
            ),
            info,
        )

    def _look_for_other_types(self) -> None:
        """The middleware says nothing when two types meet on one topic. Told once."""
        stamped = self._values["enable_stamped_cmd_vel"]
        warning = messages.type_conflict(
            self.get_publishers_info_by_topic("cmd_vel"), stamped=stamped
        )
        if warning:
            self.get_logger().warning(warning)
            self._looking.cancel()

    def _on_wheels(self, wheels: Float32MultiArray, info: MessageInfo) -> None:
        self._command(lambda session, now: session.command_wheels(wheels.data, now), info)

    def _on_pose(self, goal: PoseStamped, info: MessageInfo) -> None:
        frame = self._message_settings.odom_frame
        self._command(
            lambda session, now: session.command_pose(messages.goal_pose(goal, frame), now), info
        )

    def _command(self, action: Callable[[Session, float], None], info: MessageInfo) -> None:
        try:
            self._link.command(action, info["source_timestamp"])
        except CommandRefused as error:
            self._refusals = Refusals(count=self._refusals.count + 1, last=str(error))
            self._warn_of_refusal(str(error))

    def _warn_of_refusal(self, text: str) -> None:
        """Each kind now and then: a flood of one does not hide another."""
        kind, now_s = text.partition(":")[0], time.monotonic()
        if now_s - self._refused_at_s.get(kind, -math.inf) >= WARN_EVERY_S:
            self._refused_at_s[kind] = now_s
            self.get_logger().warning(text)

    def _on_estop_topic(self, message: Bool) -> None:
        if message.data:
            self._link.call(lambda session, now: session.estop(True, now))

    def _on_estop(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        active = bool(request.data)
        response.message = self._link.call(lambda session, now: session.estop(active, now))
        if active and self._link.blocked:
            response.message += "; the port takes nothing: the stop follows when it is open again"
        response.success = True
        return response

    def _on_reset_odometry(
        self, _request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        self._link.call(lambda session, now: session.reset_odometry(now))
        response.success = True
        response.message = "the odometry begins here"
        return response

    async def _on_start(
        self, _request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        return await self._request(Request.START, response)

    async def _on_pause(
        self, request: SetBool.Request, response: SetBool.Response
    ) -> SetBool.Response:
        return await self._request(Request.PAUSE if request.data else Request.START, response)

    async def _on_reset(
        self, _request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        return await self._request(Request.RESET, response)

    async def _on_calibrate_gyro(
        self, _request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        await self._ask(Session.calibrate_gyro, response)
        if response.success:
            bias = list(self._link.call(lambda session, _now: session.gyro_bias))
            self.set_parameters([rclpy.Parameter("gyro_bias", value=bias)])
            if file := self._values["calibration_file"]:
                await self._save(Path(file).expanduser(), bias, response)
        return response

    async def _save(self, file: Path, bias: list[float], response: Trigger.Response) -> None:
        """On a thread of its own: a disk may take its time, and nobody else is to wait for it."""
        answer = Future()

        def save() -> None:
            try:
                calibration.save(file, {"gyro_bias": bias})
                answer.set_result("")
            except Exception as error:  # whoever asked is owed an answer
                answer.set_result(str(error))
            if self.executor is not None:
                self.executor.wake()

        threading.Thread(target=save, name="omnibot-save", daemon=True).start()
        trouble = await answer
        if trouble:
            response.success = False
            response.message += f"; it is applied, but not saved: {trouble}"
        else:
            response.message += f"; saved to {file}"

    async def _request(self, request: Request, response: Any) -> Any:
        return await self._ask(
            lambda session, answer, now: session.request(request, answer, now), response
        )

    async def _ask(self, question: Callable[[Session, Future, float], None], response: Any) -> Any:
        answer = Future()
        try:
            self._link.call(lambda session, now: question(session, answer, now))
        except RequestRefused as error:
            response.success, response.message = False, str(error)
            return response
        done: RequestDone = await answer
        response.success, response.message = done.success, done.message
        return response


def _descriptor(parameter: parameters.Parameter) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(
        description=f"{parameter.description} [{parameter.unit}]"
        if parameter.unit
        else parameter.description,
        additional_constraints=parameter.allowed,
        read_only=parameter.fixed,
        dynamic_typing=True,
    )
    if parameter.low is not None and parameter.high is not None:
        if isinstance(parameter.default, int):
            whole = IntegerRange(
                from_value=int(parameter.low), to_value=int(parameter.high), step=1
            )
            descriptor.integer_range = [whole]
        else:
            span = FloatingPointRange(from_value=parameter.low, to_value=parameter.high)
            descriptor.floating_point_range = [span]
    return descriptor
