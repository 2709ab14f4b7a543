# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Topics and services that only the MART controller has.

This module only connects ROS to the session.
"""

import math
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path, PurePosixPath
from typing import Any, Final, cast

import rclpy
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import BatteryState, Range
from std_msgs.msg import Bool, Header
from std_srvs.srv import Trigger

from omnibot_driver import declaration, messages
from omnibot_driver.boards.mart_clock import clock_fields
from omnibot_driver.core.errors import RequestRefused
from omnibot_driver.core.mart.board import MartBoard
from omnibot_driver.core.mart.goal import docking_inches
from omnibot_driver.core.mart.jobs import KEPT, Job
from omnibot_driver.core.mart.readings import (
    BatteryReading,
    DockedReading,
    JobDone,
    SonarReading,
)
from omnibot_driver.core.session import Session
from omnibot_driver.files import CHECK_FOLDER, unused, write_whole
from omnibot_driver.qos import DEEP, LATCHED

NAN: Final = float("nan")
TIME_EVERY_S: Final = 1.0
NO_DATA: Final = "no valid data from the controller; check its power and the network"
ESTOP: Final = "the e-stop is latched; release it, then call again"
NOT_AT_REST: Final = (
    "the robot may still be moving, or the server is busy; end the motion commands, wait a second,"
    " then call again"
)


class MartTopics:
    """The topics and services that only the MART controller has.

    ``publish``: maps each type of reading to the method that publishes readings of this type.
    """

    def __init__(self, node: Node, link: Any, values: Mapping[str, Any]) -> None:
        self._node, self._link, self._values = node, link, values
        prefix = values["frame_prefix"]
        self._battery = node.create_publisher(BatteryState, "battery_state", 10)
        self._ranges = {
            side: (node.create_publisher(Range, f"range/{side}", 10), f"{prefix}range_{side}_link")
            for side in ("front", "rear")
        }
        self._docked = node.create_publisher(Bool, "docked", LATCHED)
        self._shown: bool | None = None
        self.publish: dict[type, Callable[[Any, int], None]] = {
            BatteryReading: self._publish_battery,
            SonarReading: self._publish_range,
            DockedReading: self._publish_docked,
            JobDone: self._answer,
        }
        group = ReentrantCallbackGroup()
        for name, job in (
            ("calibrate_gyro", Job.BIAS),
            ("dock", Job.DOCK),
            ("start_log", Job.LOG),
            ("download_last_move", Job.LAST_MOVE),
            ("download_last_turn", Job.LAST_TURN),
            ("download_log", Job.LOG_FILE),
        ):
            node.create_service(
                Trigger, f"~/{name}", self._service(job), callback_group=group, qos_profile=DEEP
            )
        if values["set_host_time"]:
            steady = Clock(clock_type=ClockType.STEADY_TIME)
            self._timer = node.create_timer(TIME_EVERY_S, self._set_time, clock=steady)
        node.add_post_set_parameters_callback(self._apply)

    def _apply(self, changed: list[rclpy.Parameter]) -> None:
        self._values = declaration.updated(self._values, changed)

    # From the board

    def _publish_battery(self, battery: BatteryReading, stamp_ns: int) -> None:
        self._battery.publish(
            BatteryState(
                header=Header(stamp=messages.time_message(stamp_ns)),
                voltage=battery.volts,
                temperature=NAN,
                current=NAN,
                charge=NAN,
                capacity=NAN,
                design_capacity=NAN,
                percentage=NAN,
                power_supply_status=BatteryState.POWER_SUPPLY_STATUS_UNKNOWN,
                power_supply_health=BatteryState.POWER_SUPPLY_HEALTH_UNKNOWN,
                power_supply_technology=BatteryState.POWER_SUPPLY_TECHNOLOGY_UNKNOWN,
                present=True,
            )
        )

    def _publish_range(self, sonar: SonarReading, stamp_ns: int) -> None:
        publisher, frame = self._ranges[sonar.side]
        farthest = self._values["range_maximum"]
        publisher.publish(
            Range(
                header=Header(stamp=messages.time_message(stamp_ns), frame_id=frame),
                radiation_type=messages.RADIATION[self._values["range_type"]],
                field_of_view=self._values["range_field_of_view"],
                min_range=self._values["range_minimum"],
                max_range=farthest,
                range=sonar.distance_m if sonar.distance_m <= farthest else math.inf,
            )
        )

    def _publish_docked(self, docked: DockedReading, _stamp_ns: int) -> None:
        if docked.docked is not self._shown:
            self._shown = docked.docked
            self._docked.publish(Bool(data=docked.docked))

    # To the board

    def _service(self, job: Job) -> Callable[..., Any]:
        async def serve(_request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            arguments: tuple[object, ...] = ()
            if job is Job.DOCK:
                arguments = ("DOCK", docking_inches(self._values["dock_distance"]))
            done = await self._ask(job, arguments)
            response.success, response.message = done.success, done.message
            if done.success and done.name:
                response.success, response.message = await self._save(done)
                if job is Job.LOG_FILE and not response.success:  # the driver cannot repeat it
                    response.message += f"; {KEPT}"
            return response

        return serve

    async def _ask(self, job: Job, arguments: tuple[object, ...]) -> JobDone:
        answer = Future()

        def ask(session: Session, now: float) -> str:
            board = cast(MartBoard, session.board)
            if why := session.interlocks.why_not_request():
                return str(why)
            if session.state != "nominal":
                return NO_DATA
            if session.estop_active:
                return ESTOP
            if not board.resting:
                return NOT_AT_REST
            if job is Job.DOCK and (why := session.interlocks.why_not_move_by_itself(now)):
                return str(why)
            try:
                board.ask(job, answer, now, *arguments)
            except RequestRefused as error:
                return str(error)
            return ""

        if refused := self._link.call(ask):
            return JobDone(None, False, f"{job.value} refused: {refused}")
        done: JobDone = await answer
        return done

    async def _save(self, done: JobDone) -> tuple[bool, str]:
        """Write a downloaded file in a separate thread, because the disk may be slow.

        Returns whether the file was written, and the message for the caller of the service.
        """
        answer = Future()

        def save() -> None:
            try:
                directory = Path(self._values["record_directory"]).expanduser()
                path = unused((directory / PurePosixPath(done.name).name).absolute())
                write_whole(path, lambda file: file.write(done.content.decode("latin-1")))
                answer.set_result((True, str(path)))
            except Exception as error:  # the caller must get an answer
                answer.set_result((False, f"{error}; {CHECK_FOLDER}"))
            if self._node.executor is not None:
                self._node.executor.wake()

        try:
            threading.Thread(target=save, name="omnibot-save", daemon=True).start()
        except RuntimeError as error:  # the limit of processes: the caller must get an answer
            answer.set_result((False, str(error)))
        saved, text = await answer
        if not saved:
            return False, f"{done.message}; not saved: {text}"
        _, _, more = done.message.partition("; ")
        return True, text + (f"; {more}" if more else "")

    def _answer(self, done: JobDone, _stamp_ns: int) -> None:
        if isinstance(done.token, Future):
            done.token.set_result(done)
            if self._node.executor is not None:
                self._node.executor.wake()
        elif done.success:
            self._timer.cancel()

    def _set_time(self) -> None:
        """Set the controller's clock if measurements show that the robot is at rest.

        A timer calls this method repeatedly until the clock is set.
        """

        def ask(session: Session, now: float) -> None:
            board = cast(MartBoard, session.board)
            fields = clock_fields(time.time(), may_set_back=board.is_fresh)
            if session.state == "nominal" and board.resting and fields:
                try:
                    board.ask(Job.TIME, None, now, *fields)
                except RequestRefused:
                    return

        self._link.call(ask)
