# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The ROS node: it connects topics, services and parameters to a link and its session.

This module does not compute anything. The link's reader thread publishes the measurements.
"""

import math
import time
import traceback
from collections.abc import Callable
from functools import partial
from typing import Any

import rclpy
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy._rclpy_pybind11 import RCLError
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from std_msgs.msg import Bool, Float32MultiArray

from omnibot_driver import boards, cdr, declaration, messages, parameters, selfcheck
from omnibot_driver.command_messages import (
    age,
    body_twist,
    goal_pose,
    is_planar,
    is_stamped,
    is_zero,
)
from omnibot_driver.command_topics import Action, obeying
from omnibot_driver.core.commands.set_points import Authority
from omnibot_driver.core.reporting.figures import Refusals
from omnibot_driver.core.session import Session
from omnibot_driver.diagnostics import Diagnostics
from omnibot_driver.link import Link
from omnibot_driver.publishing import Publishing
from omnibot_driver.qos import DEEP
from omnibot_driver.recording import is_recording, open_recording
from omnibot_driver.replay import Replay
from omnibot_driver.services import Services

LOOK_EVERY_S = WARN_EVERY_S = 2.0


class OmniBotDriver(Node):
    """The driver node. Raises ParameterError if it cannot start with the given parameters.

    ``end`` is called when the driver has to end. Its argument is the exception that a bug has
    raised, or None.
    """

    def __init__(
        self, *, end: Callable[[BaseException | None], object] = lambda _error: None
    ) -> None:
        super().__init__("omnibot_driver")
        self._end = end
        self._values = declaration.declare(self)
        self.add_post_set_parameters_callback(self._apply_parameters)
        port = self._values["port"]
        self._profile = boards.load(self._values["board"])
        self._board = self._profile.make(self._values)
        self._session = Session(
            self._board,
            parameters.session_settings(self._values, self._profile.kinematics(self._values)),
            run=self._values.get("auto_start", True),
            axis_signs=tuple(self._values.get("axis_signs", (1, 1, 1))),
            control=self._values.get("control_method"),
            obeys=not is_recording(port),
        )
        settings = self._message_settings()
        self._publishing = Publishing(
            self, self._session, self._board.traits, self._values, settings
        )
        self._refused_at_s: dict[str, float] = {}
        self._refusals = Refusals()
        self._link = self._make_link(port)
        self._requests = Services(
            self, self._link, self._board.traits, self._values["calibration_file"]
        )
        self._create_inputs()
        self._publishing.extras = self._profile.extras(self, self._link, self._values)
        if isinstance(self._link, Link):  # a recording has no link to judge
            self._diagnostics = Diagnostics(
                self,
                self._link,
                lambda: self._refusals,
                hardware_id=port,
                to_check=self._board.traits.to_check,
            )
        simulated_time = self.get_parameter("use_sim_time").value
        for advice in (
            selfcheck.clock_advice(port, simulated_time),
            selfcheck.prefix_advice(self._values["frame_prefix"]),
        ):
            if advice:
                self.get_logger().warning(advice)
        self.get_logger().info(f"core: {selfcheck.core_kind()}")
        self._publishing.publish_state()
        self._link.start()

    def create_publisher(self, kind: type, topic: str, qos: Any, **options: Any) -> Publisher:
        """Create a publisher without callbacks for quality-of-service events.

        Such callbacks would delay the handling of commands.
        """
        quiet = PublisherEventCallbacks(use_default_callbacks=False)
        return super().create_publisher(kind, topic, qos, event_callbacks=quiet, **options)

    def create_service(
        self, kind: type, name: str, callback: Callable[[Any, Any], Any], **options: Any
    ) -> Any:
        """Create a service.

        If the service sets parameters, the driver's own callback replaces ``callback``.
        """
        own = {SetParameters: declaration.set_each, SetParametersAtomically: declaration.set_all}
        if kind in own:
            callback = partial(own[kind], self)
        return super().create_service(kind, name, callback, **options)

    def _make_link(self, port: str) -> Link | Replay:
        if is_recording(port):
            return Replay(
                self._session,
                open_recording(port, self._board.traits.channels),
                deliver=self._publishing.publish,
                report=self._publishing.report_port,
                failed=self.report_defect,
                refused=self._refuse,
            )
        taps = self._publishing.taps() if self._values["publish_raw"] else {}
        return Link(
            self._session,
            boards.opener(self._profile, self._values),
            port,
            guard=self._values["guard"],
            reconnect_interval_s=self._values["reconnect_interval"],
            deliver=self._publishing.deliver,
            report=self._publishing.report_port,
            failed=self.report_defect,
            refused=self._refuse,
            **taps,
        )

    def close(self) -> None:
        """Stop the robot and close the port. Topics and services remain until ``destroy_node``."""
        if not self._link.close(self._values["on_exit"]):
            if self._link.unstopped:
                self.get_logger().warning(
                    "the stop could not be sent, because the port is lost or accepts no data;"
                    " check by eye that the robot has stopped"
                )
            return
        if self._link.stands:
            self.get_logger().info("robot stopped and port closed")
        else:
            self.get_logger().warning(
                "stop sent but unconfirmed, port closed; check by eye that the robot has stopped"
            )

    def report_defect(self, error: BaseException) -> None:
        """Log an exception that only a defect can cause, and end the driver."""
        if isinstance(error, RCLError) and not self.context.ok():
            self._end(None)  # ROS was shut down meanwhile: not a defect
            return
        trace = "".join(traceback.format_exception(error))
        self.get_logger().fatal(
            f"the driver ends because of a bug in it; please report this:\n{trace}"
        )
        self._end(error)

    def _message_settings(self) -> messages.MessageSettings:
        wheels = self._profile.kinematics(self._values)
        return messages.MessageSettings.from_parameters(self._values, wheels)

    def _apply_parameters(self, changed: list[rclpy.Parameter]) -> None:
        self._values = declaration.updated(self._values, changed)
        self._publishing.settings = self._message_settings()
        self._link.reconnect_interval_s = self._values["reconnect_interval"]
        wheels = self._profile.kinematics(self._values)
        settings = parameters.session_settings(self._values, wheels)
        board = self._profile.settings(self._values)
        bias = any(parameter.name == "gyro_bias" for parameter in changed)

        def configure(session: Session, now: float) -> None:
            session.configure(settings, now, board=board)
            if bias:  # even if unchanged: the session may have refined its own bias
                session.gyro_bias = settings.imu.gyro_bias

        self._link.call(configure)

    # From ROS to the board

    def _create_inputs(self) -> None:
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._looks = [self._see_namesakes, self._see_no_clock]
        self.create_timer(LOOK_EVERY_S, self._look_around, clock=steady)
        authorities = self._board.traits.authorities
        if Authority.BASE in authorities:
            self._looks.append(self._see_other_types)
            if self._values["enable_stamped_cmd_vel"]:
                obey = self._obey(
                    "cmd_vel",
                    self._twist_stamped,
                    may_be_old=is_stamped,
                    ends_goal=lambda stamped: is_zero(stamped.twist),
                )
                self.create_subscription(TwistStamped, "cmd_vel", obey, 1)
            else:
                obey = self._obey("cmd_vel", _twist, ends_goal=cdr.is_zero)
                self.create_subscription(Twist, "cmd_vel", obey, 1, raw=True)
        if Authority.WHEELS in authorities:
            obey = self._obey("wheel_cmd", _wheels)
            self.create_subscription(Float32MultiArray, "wheel_cmd", obey, 1)
        if Authority.POSE in authorities:
            obey = self._obey("cmd_pose", self._pose)  # a planner's stamp is not the send time
            self.create_subscription(PoseStamped, "cmd_pose", obey, 1)
        self.create_subscription(Bool, "estop", self._on_estop_topic, DEEP)

    def _obey(
        self,
        topic: str,
        action: Action,
        **judges: Callable[[Any], bool],
    ) -> Callable[..., None]:
        def expires_s() -> float:
            return float(self._values["cmd_vel_timeout"])

        return obeying(self._link, topic, action, expires_s, **judges)

    def _twist_stamped(self, session: Session, stamped: TwistStamped, now: float) -> None:
        age_s = age(stamped.header.stamp, self.get_clock().now().nanoseconds)
        twist, planar = body_twist(stamped.twist), is_planar(stamped.twist)
        session.command_twist(twist, now, age_s=age_s, planar=planar)

    def _pose(self, session: Session, goal: PoseStamped, now: float) -> None:
        frame = self._publishing.settings.odom_frame
        session.command_pose(goal_pose(goal, frame), now)

    def _look_around(self) -> None:
        """Warn once of each mistake that ROS does not report, e.g. two nodes with the same name."""
        for look in list(self._looks):
            if warning := look():
                self.get_logger().warning(warning)
                self._looks.remove(look)

    def _see_other_types(self) -> str:
        stamped = self._values["enable_stamped_cmd_vel"]
        publishers = self.get_publishers_info_by_topic("cmd_vel")
        return selfcheck.type_conflict(publishers, stamped=stamped)

    def _see_namesakes(self) -> str:
        publishers = self.get_publishers_info_by_topic("~/state")
        return selfcheck.namesake_advice(self.get_fully_qualified_name(), publishers)

    def _see_no_clock(self) -> str:
        return selfcheck.waiting_advice(self._values["port"], self.get_clock().now().nanoseconds)

    def _refuse(self, text: str) -> None:
        """Count each refusal; log each kind of refusal at most once in 2 s (``WARN_EVERY_S``)."""
        self._refusals = Refusals(count=self._refusals.count + 1, last=text)
        kind, now_s = text.partition(":")[0], time.monotonic()
        if now_s - self._refused_at_s.get(kind, -math.inf) >= WARN_EVERY_S:
            self._refused_at_s[kind] = now_s
            self.get_logger().warning(text)

    def _on_estop_topic(self, message: Bool) -> None:
        if message.data:
            self._link.call(lambda session, now: session.estop(True, now, by="the topic estop"))


def _twist(session: Session, data: bytes, now: float) -> None:
    twist, planar = cdr.twist(data)
    session.command_twist(twist, now, planar=planar)


def _wheels(session: Session, wheels: Float32MultiArray, now: float) -> None:
    session.command_wheels(wheels.data, now)
