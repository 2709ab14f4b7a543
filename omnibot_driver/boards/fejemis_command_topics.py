# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Services and topics that give commands only to a Fejemis: its jobs, brush, lift and LED."""

import math
from collections.abc import Callable, Mapping
from typing import Any, Final, cast

import rclpy
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import ColorRGBA, Float32
from std_srvs.srv import SetBool, Trigger

from omnibot_driver.command_topics import obeying
from omnibot_driver.core.errors import CommandRefused, RequestRefused
from omnibot_driver.core.fejemis import Job, JobDone
from omnibot_driver.core.fejemis.board import FejemisBoard
from omnibot_driver.core.fejemis.services import Services
from omnibot_driver.core.session import Session
from omnibot_driver.qos import DEEP
from omnibot_driver.services import ask

WARN_EVERY_S: Final = 2.0
NOT_CONNECTED: Final = "the boards are not connected; check their power, cables and ports"
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


class FejemisCommands:
    """The services and topics for commands that only a Fejemis has.

    * ``values``: the parameter values, which the owner replaces when the user sets a parameter.
    * ``publish``: for each type of reading, the function that handles such a reading.
    """

    def __init__(self, node: Node, link: Any, values: Mapping[str, Any]) -> None:
        self._node, self._link, self.values = node, link, values
        self.publish: dict[type, Callable[[Any, int], None]] = {JobDone: self._answer}
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
        node.create_subscription(Float32, "lift_cmd", self._lift(), 1)
        node.create_subscription(ColorRGBA, "led_cmd", self._on_led, 1)

    def _service(self, job: Job) -> Callable[..., Any]:
        async def serve(_request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            def begin(session: Session, answer: Future, now: float) -> None:
                if why := _why_not_request(job.value, session):
                    raise RequestRefused(why)
                cast(FejemisBoard, session.board).services.ask(job, answer, now)

            await ask(self._link, begin, response)
            if response.success and job in BIASES:
                response.message += self._forget_bias(BIASES[job])
            return response

        return serve

    def _forget_bias(self, name: str) -> str:
        """Set the parameter ``name``, a bias, to zero, because the board now subtracts the bias.

        Return a remark for the service's answer; empty if the parameter was zero.
        """
        was_set = any(self.values[name])
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

    def _lift(self) -> Callable[..., None]:
        """Return the callback of ``lift_cmd``.

        It obeys a command of 0 V in any state of the boards, even if the command is old.
        """

        def lift(session: Session, message: Float32, now: float) -> None:
            board = cast(FejemisBoard, session.board)
            if message.data and (why := _why_not_request("lift_cmd", session)):
                raise CommandRefused(why)
            board.services.lift(message.data, now)

        return obeying(
            self._link,
            "lift_cmd",
            lift,
            lambda: float(self.values["cmd_vel_timeout"]),
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
        """Call ``action``; return the reason for a refusal, a warning, or an empty string.

        ``off``: whether ``action`` switches a device off, which only a replay refuses. If a port is
        closed, the warning says that the device may still be on.
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
