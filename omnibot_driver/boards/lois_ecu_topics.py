# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Topics and services that only the LOIS ECU has. This module only connects ROS to the session."""

from collections.abc import Callable, Mapping
from enum import Enum
from typing import Any, Final, cast

import rclpy
from rclpy.node import Node
from sensor_msgs.msg import Imu, NavSatFix, NavSatStatus, TimeReference
from std_msgs.msg import Bool, Float32MultiArray, Header, String
from std_srvs.srv import SetBool, Trigger

from omnibot_driver import declaration, messages
from omnibot_driver.boards.lois_ecu_record_topics import Recorder
from omnibot_driver.command_topics import obeying
from omnibot_driver.core.commands.limits import require_finite
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.lois_ecu import TerminalLine
from omnibot_driver.core.lois_ecu.board import LoisEcuBoard
from omnibot_driver.core.lois_ecu.readings import (
    FixReading,
    HeadingReading,
    TerminalLeft,
    TimeReading,
)
from omnibot_driver.core.readings import EStopButtonReading
from omnibot_driver.core.session import Session
from omnibot_driver.qos import DEEP, LATCHED

FIX_VARIANCE_M2: Final = 0.4**2
"""Variance in m² that comes from the rounding of a longitude to float32. The error of the GPS
itself is larger; the board does not report it."""
GPS_VARIANCE_M2: Final = 5.0**2
ABSENT: Final = [-1.0] + [0.0] * 8
TERMINAL_DEPTH: Final = 100
LEFT: Final = (
    "the board has left its terminal mode; check the e-stop button: its presses and releases in"
    " that mode were not reported"
)
NOT_HEARD: Final = "no data from the board; connect it and switch it on, then call again"


class OwnTopic(Enum):
    """The command topic that only the LOIS ECU has."""

    DUTY = "duty_cmd"


class LoisEcuTopics:
    """The topics and services that only the LOIS ECU has.

    ``publish``: for each type of reading, the function that publishes it.
    """

    def __init__(self, node: Node, link: Any, values: Mapping[str, Any]) -> None:
        self._node, self._link, self._values = node, link, values
        prefix = values["frame_prefix"]
        self._gps_frame, self._heading_frame = prefix + "gps_link", prefix + "compass_link"
        self._fix = node.create_publisher(NavSatFix, "fix", 10)
        self._time = node.create_publisher(TimeReference, "time_reference", 10)
        self._heading = node.create_publisher(Imu, "imu/heading", 10)
        self._button = node.create_publisher(Bool, "estop_button", LATCHED)
        self.publish: dict[type, Callable[[Any, int], None]] = {
            FixReading: self._publish_fix,
            TimeReading: self._publish_time,
            HeadingReading: self._publish_heading,
            TerminalLine: self._publish_terminal,
            TerminalLeft: lambda _left, _stamp_ns: node.get_logger().warning(LEFT),
            EStopButtonReading: lambda button, _stamp_ns: self._button.publish(
                Bool(data=button.pressed)
            ),
        }
        self.publish |= Recorder(node, link, lambda: self._values).publish
        node.create_service(SetBool, "~/led", self._on_led, qos_profile=DEEP)
        node.create_service(Trigger, "~/distribute_ball", self._on_ball, qos_profile=DEEP)
        self._duty: Any = None
        self._terminal: Any = None
        self._make_what_the_modes_need()
        node.add_post_set_parameters_callback(self._apply)

    def _apply(self, changed: list[rclpy.Parameter]) -> None:
        self._values = declaration.updated(self._values, changed)
        self._make_what_the_modes_need()

    def _make_what_the_modes_need(self) -> None:
        """Create and remove topics for the parameters ``drive_mode`` and ``terminal_mode``.

        ``duty_cmd`` exists only in duty mode. ``~/terminal`` is created in a terminal mode, and
        then stays. Call this method on the executor's thread.
        """
        duty, terminal = (
            self._values["drive_mode"] == "duty",
            self._values["terminal_mode"] != "host",
        )
        if duty and self._duty is None:
            obey = obeying(self._link, "duty_cmd", self._drive, self._expires_s)
            self._duty = self._node.create_subscription(Float32MultiArray, "duty_cmd", obey, 1)
        elif not duty and self._duty is not None:
            self._node.destroy_subscription(self._duty)
            self._duty = None
        if terminal and self._terminal is None:  # never removed: the reader's thread may use it
            self._terminal = self._node.create_publisher(String, "~/terminal", TERMINAL_DEPTH)

    # From the board

    def _publish_fix(self, fix: FixReading, stamp_ns: int) -> None:
        status = NavSatStatus.STATUS_FIX if fix.valid else NavSatStatus.STATUS_NO_FIX
        variance = FIX_VARIANCE_M2 + GPS_VARIANCE_M2
        self._fix.publish(
            NavSatFix(
                header=Header(stamp=messages.time_message(stamp_ns), frame_id=self._gps_frame),
                status=NavSatStatus(status=status, service=NavSatStatus.SERVICE_GPS),
                latitude=fix.latitude_deg,
                longitude=fix.longitude_deg,
                altitude=float("nan"),
                position_covariance=[variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, 1e6],
                position_covariance_type=NavSatFix.COVARIANCE_TYPE_APPROXIMATED,
            )
        )

    def _publish_time(self, time: TimeReading, stamp_ns: int) -> None:
        if time.utc_s is None:
            return
        self._time.publish(
            TimeReference(
                header=Header(stamp=messages.time_message(stamp_ns)),
                time_ref=messages.time_message(time.utc_s * 10**9),
                source="gps",
            )
        )

    def _publish_heading(self, heading: HeadingReading, stamp_ns: int) -> None:
        variance = self._values["heading_stddev"] ** 2
        self._heading.publish(
            Imu(
                header=Header(stamp=messages.time_message(stamp_ns), frame_id=self._heading_frame),
                orientation=messages.yaw_quaternion(heading.yaw_rad),
                orientation_covariance=[1e6, 0.0, 0.0, 0.0, 1e6, 0.0, 0.0, 0.0, variance],
                angular_velocity_covariance=ABSENT,
                linear_acceleration_covariance=ABSENT,
            )
        )

    def _publish_terminal(self, line: TerminalLine, _stamp_ns: int) -> None:
        if self._terminal is not None:
            self._terminal.publish(String(data=line.text))

    # To the board

    def _on_led(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        on = bool(request.data)
        return self._say(
            lambda board, now: board.set_led(on, now),
            f"the command to switch the LED {'on' if on else 'off'} was sent; the board does not"
            " confirm it",
            response,
        )

    def _on_ball(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return self._say(
            lambda board, _now: board.distribute_ball(),
            "the ball command was sent once; the board does not confirm it",
            response,
        )

    def _say(
        self, action: Callable[[LoisEcuBoard, float], None], message: str, response: Any
    ) -> Any:
        def say(session: Session, now: float) -> str:
            if why := session.interlocks.why_not_write():
                return why
            if not session.board.mode.running or session.state == "disconnected":
                return NOT_HEARD
            action(cast(LoisEcuBoard, session.board), now)
            return ""

        refused = self._link.call(say)
        response.success, response.message = not refused, refused or message
        return response

    def _expires_s(self) -> float:
        return float(self._values["cmd_vel_timeout"])

    def _drive(self, session: Session, message: Float32MultiArray, now: float) -> None:
        """Convert the message's motor duties (in percent) to wheel rates; command these rates."""
        duties = list(message.data)
        require_finite("duty_cmd", duties)
        if len(duties) != 2:
            raise CommandRefused(
                f"duty_cmd rejected: it has {len(duties)} values; send exactly 2, left and right"
            )
        settings = session.board.settings
        if settings.drive_mode != "duty":
            raise CommandRefused(
                "duty_cmd refused: drive_mode is rpm; set it to duty to drive without the speed"
                " controller"
            )
        rate_radps = 1.0 / (settings.duty_scale * settings.wheel_radius_m)
        session.command_wheels([duty * rate_radps for duty in duties], now, by=OwnTopic.DUTY)
