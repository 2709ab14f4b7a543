# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Topics and services that only a Fejemis has. This module only connects ROS to the session."""

import math
from collections.abc import Callable, Mapping
from typing import Any, Final, cast

import rclpy
from geometry_msgs.msg import Quaternion, Vector3
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.task import Future
from sensor_msgs.msg import BatteryState, Imu, JointState, MagneticField, Range
from std_msgs.msg import ColorRGBA, Float32, Header
from std_srvs.srv import SetBool, Trigger

from omnibot_driver import declaration, messages
from omnibot_driver.command_topics import obeying
from omnibot_driver.core.errors import CommandRefused, RequestRefused
from omnibot_driver.core.fejemis import (
    BatteryReading,
    Job,
    JobDone,
    MagneticReading,
    OrientedImuReading,
    RangeReading,
    SteeringReading,
)
from omnibot_driver.core.fejemis.board import FejemisBoard
from omnibot_driver.core.fejemis.services import Services
from omnibot_driver.core.geometry.steered import SteeredKinematics
from omnibot_driver.core.session import Session
from omnibot_driver.qos import DEEP

NAN: Final = float("nan")
WARN_EVERY_S: Final = 2.0
STEERING_EVERY_NS: Final = 40_000_000
"""Shortest time between two published steering angles, in ns.

The board sends 66 angles per second; an angle that comes earlier is not published.
"""
NOT_CONNECTED: Final = "the boards are not connected; check their power, cables and ports"
RANGES: Final = ("tof", "sonar", "ir1", "ir2")
SERVICES: Final = {
    "calibrate_gyro": Job.CALIBRATE_GYRO,
    "calibrate_accelerometer": Job.CALIBRATE_ACCELEROMETER,
    "save_configuration": Job.SAVE,
    "load_configuration": Job.LOAD,
    "power_off": Job.POWER_OFF,
}
BIASES: Final = {
    Job.CALIBRATE_GYRO: "gyro_bias",
    Job.CALIBRATE_ACCELEROMETER: "accel_bias",
}
"""For each calibration: the parameter with the bias that the driver subtracts.

After the calibration, the board subtracts the bias itself. The driver must not subtract it again.
"""


class FejemisTopics:
    """The topics and services that only a Fejemis has.

    ``publish``: a mapping from each type of reading to the method that publishes it.
    """

    def __init__(self, node: Node, link: Any, values: Mapping[str, Any]) -> None:
        self._node, self._link, self._values = node, link, values
        self._prefix = values["frame_prefix"]
        self._steering = _publisher_of(node, "joint_states")
        self._imu = node.create_publisher(Imu, "imu/data", 10)
        self._mag = node.create_publisher(MagneticField, "imu/mag", 10)
        self._battery = node.create_publisher(BatteryState, "battery_state", 10)
        self._ranges = {name: node.create_publisher(Range, f"range/{name}", 10) for name in RANGES}
        self._steered_ns = 0
        self.publish: dict[type, Callable[[Any, int], None]] = {
            SteeringReading: self._publish_steering,
            OrientedImuReading: self._publish_imu,
            MagneticReading: self._publish_mag,
            BatteryReading: self._publish_battery,
            RangeReading: self._publish_range,
            JobDone: self._answer,
        }
        waiting = ReentrantCallbackGroup()
        for name, job in SERVICES.items():
            node.create_service(
                Trigger,
                f"~/{name}",
                self._service(job),
                callback_group=waiting,
                qos_profile=DEEP,
            )
        node.create_service(SetBool, "~/brush", self._on_brush, qos_profile=DEEP)
        node.create_subscription(Float32, "lift_cmd", self._lift(link), 1)
        node.create_subscription(ColorRGBA, "led_cmd", self._on_led, 1)
        node.add_post_set_parameters_callback(self._apply)

    def _apply(self, changed: list[rclpy.Parameter]) -> None:
        self._values = declaration.updated(self._values, changed)

    # From the boards

    def _header(self, stamp_ns: int, frame: str = "") -> Header:
        frame_id = self._prefix + frame if frame else ""
        return Header(stamp=messages.time_message(stamp_ns), frame_id=frame_id)

    def _publish_steering(self, steering: SteeringReading, stamp_ns: int) -> None:
        if 0 <= stamp_ns - self._steered_ns < STEERING_EVERY_NS:
            return
        self._steered_ns = stamp_ns
        self._steering.publish(
            JointState(
                header=self._header(stamp_ns),
                name=[SteeredKinematics.steering_joint],
                position=[steering.angle_rad],
            )
        )

    def _publish_imu(self, imu: OrientedImuReading, stamp_ns: int) -> None:
        x, y, z, w = imu.orientation
        roll, pitch, yaw = (stddev**2 for stddev in self._values["orientation_stddev"])
        self._imu.publish(
            Imu(
                header=self._header(stamp_ns, self._values["imu_frame"]),
                orientation=Quaternion(x=x, y=y, z=z, w=w),
                orientation_covariance=[roll, 0.0, 0.0, 0.0, pitch, 0.0, 0.0, 0.0, yaw],
                angular_velocity=_vector(imu.angular_velocity),
                angular_velocity_covariance=messages.isotropic(
                    self._values["angular_velocity_stddev"]
                ),
                linear_acceleration=_vector(imu.specific_force),
                linear_acceleration_covariance=messages.isotropic(
                    self._values["linear_acceleration_stddev"]
                ),
            )
        )

    def _publish_mag(self, mag: MagneticReading, stamp_ns: int) -> None:
        self._mag.publish(
            MagneticField(
                header=self._header(stamp_ns, self._values["imu_frame"]),
                magnetic_field=_vector(mag.field_t),
                magnetic_field_covariance=messages.isotropic(self._values["magnetic_field_stddev"]),
            )
        )

    def _publish_battery(self, battery: BatteryReading, stamp_ns: int) -> None:
        status = BatteryState.POWER_SUPPLY_STATUS_UNKNOWN
        if battery.amps < 0.0:
            status = BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
        self._battery.publish(
            BatteryState(
                header=self._header(stamp_ns),
                voltage=battery.volts,
                temperature=NAN,
                current=battery.amps,
                charge=NAN,
                capacity=NAN,
                design_capacity=NAN,
                percentage=NAN,
                power_supply_status=status,
                power_supply_health=BatteryState.POWER_SUPPLY_HEALTH_UNKNOWN,
                power_supply_technology=BatteryState.POWER_SUPPLY_TECHNOLOGY_LIPO,
                present=True,
                cell_voltage=[NAN] * battery.cells,
            )
        )

    def _publish_range(self, reading: RangeReading, stamp_ns: int) -> None:
        kind = reading.name.rstrip("12")
        nearest, farthest = self._values[f"{kind}_minimum"], self._values[f"{kind}_maximum"]
        seen = 0.0 < reading.distance_m <= farthest
        self._ranges[reading.name].publish(
            Range(
                header=self._header(stamp_ns, f"range_{reading.name}_link"),
                radiation_type=messages.RADIATION[self._values[f"{kind}_type"]],
                field_of_view=self._values[f"{kind}_field_of_view"],
                min_range=nearest,
                max_range=farthest,
                range=reading.distance_m if seen else math.inf,
            )
        )

    # To the boards

    def _service(self, job: Job) -> Callable[..., Any]:
        async def serve(_request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            answer = Future()

            def ask(session: Session, now: float) -> None:
                if why := _why_not_request(job.value, session):
                    raise RequestRefused(why)
                cast(FejemisBoard, session.board).services.ask(job, answer, now)

            try:
                self._link.call(ask)
            except RequestRefused as error:
                response.success, response.message = False, str(error)
                return response
            done: JobDone = await answer
            response.success, response.message = done.success, done.message
            if done.success and job in BIASES:
                response.message += self._forget_bias(BIASES[job])
            return response

        return serve

    def _forget_bias(self, name: str) -> str:
        """Set the parameter ``name``, a bias, to zero, because the board now subtracts the bias.

        Return a remark for the service's answer; empty if the parameter was zero.
        """
        was_set = any(self._values[name])
        # Even if the parameter was zero: the driver may have refined the gyro's bias.
        self._node.set_parameters([rclpy.Parameter(name, value=[0.0, 0.0, 0.0])])
        return (
            f"; the driver's parameter {name} is now 0, so call ~/save_configuration, and remove"
            f" {name} from your files"
            if was_set
            else ""
        )

    def _answer(self, done: JobDone, _stamp_ns: int) -> None:
        if isinstance(done.token, Future):
            done.token.set_result(done)
            if self._node.executor is not None:
                self._node.executor.wake()

    def _on_brush(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        on = bool(request.data)
        trouble = self._say("brush", lambda services, now: services.set_brush(on, now), off=not on)
        response.success = not trouble
        sent = (
            f"the command to switch the brush {'on' if on else 'off'} was sent; the board does"
            " not confirm it"
        )
        response.message = trouble or sent
        return response

    def _lift(self, link: Any) -> Callable[..., None]:
        """Return the callback of ``lift_cmd``.

        It obeys a command of 0 V in any state of the boards, even if the command is old.
        """

        def lift(session: Session, message: Float32, now: float) -> None:
            board = cast(FejemisBoard, session.board)
            if message.data and (why := _why_not_request("lift_cmd", session)):
                raise CommandRefused(why)
            board.services.lift(message.data, now)

        return obeying(
            link,
            "lift_cmd",
            lift,
            lambda: float(self._values["cmd_vel_timeout"]),
            is_stop=lambda message: message.data == 0.0,
            moves_base=False,
        )

    def _on_led(self, message: ColorRGBA) -> None:
        parts = (message.r, message.g, message.b)
        if not all(math.isfinite(part) for part in (*parts, message.a)):
            self._warn("led_cmd rejected: contains NaN or infinity; fix the publishing node")
            return
        red, green, blue = (round(255 * max(0.0, min(1.0, part * message.a))) for part in parts)
        if trouble := self._say(
            "led_cmd", lambda services, now: services.set_led(red, green, blue, now), off=False
        ):
            self._warn(trouble)

    def _say(self, what: str, action: Callable[[Services, float], None], *, off: bool) -> str:
        """Call ``action``; return the reason for a refusal, or an empty string.

        ``off``: whether ``action`` switches a device off. Such an action is called in any state of
        the boards, except in a replay. If a port is closed, the method then returns a warning.
        """

        def say(session: Session, now: float) -> str:
            if not (off and session.interlocks.obeys) and (why := _why_not_request(what, session)):
                return why
            try:
                action(cast(FejemisBoard, session.board).services, now)
            except RequestRefused as error:
                return str(error)
            return _why_not_off(what, session) if off else ""

        trouble: str = self._link.call(say)
        return trouble

    def _warn(self, text: str) -> None:
        self._node.get_logger().warning(text, throttle_duration_sec=WARN_EVERY_S)


def _why_not_request(what: str, session: Session) -> str:
    """Return why a topic, device or job (``what``) is refused now; empty if it is allowed."""
    why: str = session.interlocks.why_not_write()
    if not why and session.state == "disconnected":
        why = NOT_CONNECTED
    elif not why and session.state == "connecting":
        why = session.board.refusal or NOT_CONNECTED
    return f"{what} refused: {why}" if why else ""


def _why_not_off(what: str, session: Session) -> str:
    """Return a warning that ``what`` may still be on; empty if all ports are open."""
    why = NOT_CONNECTED if session.state == "disconnected" else session.interlocks.missing
    later = "; the driver switches it off again when all ports are open"
    return f"{what} may still be on: {why}{later}" if why else ""


def _publisher_of(node: Node, topic: str) -> Publisher:
    """Return the publisher of a topic that every board has. The driver has already created it."""
    name = node.resolve_topic_name(topic)
    return next(one for one in node.publishers if one.topic_name == name)


def _vector(parts: tuple[float, float, float]) -> Vector3:
    x, y, z = parts
    return Vector3(x=x, y=y, z=z)
