# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Services that record readings of the LOIS ECU, and answer when the file is written.

This module only connects ROS to the session.
"""

import threading
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Final, cast

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import Trigger

from omnibot_driver.boards import lois_ecu_records
from omnibot_driver.core.errors import RequestRefused
from omnibot_driver.core.lois_ecu import RecordKind
from omnibot_driver.core.lois_ecu.board import LoisEcuBoard
from omnibot_driver.core.lois_ecu.readings import RecordComes, RecordFailed, RecordReading
from omnibot_driver.core.session import Session
from omnibot_driver.files import CHECK_FOLDER
from omnibot_driver.qos import DEEP
from omnibot_driver.services import ask

LONGEST_S: Final = 120.0
NAMES: Final = {
    RecordKind.RPM: "record of RPM",
    RecordKind.TORQUE: "record of torque",
    RecordKind.HEADING: "record of headings",
}


class Recorder:
    """The services of one node that start records.

    ``values``: function that returns the current parameter values.
    ``publish``: for each type of result, the function that receives it.
    """

    def __init__(self, node: Node, link: Any, values: Callable[[], Mapping[str, Any]]) -> None:
        self._node, self._link, self._values = node, link, values
        self._token: Future | None = None
        self.publish: dict[type, Callable[[Any, int], None]] = {
            RecordReading: self._on_record,
            RecordFailed: self._on_failed,
            RecordComes: lambda _comes, _stamp_ns: None,  # shows only that a record arrives
        }
        waiting = ReentrantCallbackGroup()
        for kind in RecordKind:
            node.create_service(
                Trigger,
                f"~/record_{kind.value}",
                partial(self._on_service, kind),
                callback_group=waiting,
                qos_profile=DEEP,
            )

    async def _on_service(
        self, kind: RecordKind, _request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        samples = int(self._values()["record_samples"])

        def begin(session: Session, answer: Future, now: float) -> None:
            session.begin_task(NAMES[kind], answer, LONGEST_S, now)
            try:
                cast(LoisEcuBoard, session.board).record(kind, samples)
            except RequestRefused as error:
                session.end_task(answer, False, str(error))
            self._token = answer

        answered: Trigger.Response = await ask(self._link, begin, response)
        return answered

    def _on_failed(self, failed: RecordFailed, _stamp_ns: int) -> None:
        self._end(self._token, False, f"the record failed: {failed.reason}")

    def _on_record(self, reading: RecordReading, _stamp_ns: int) -> None:
        """Write the record on a separate thread, so that a slow disk does not delay the reader."""
        token = self._token
        save = partial(self._save, token, reading)
        try:
            threading.Thread(target=save, name="omnibot-record", daemon=True).start()
        except RuntimeError as error:  # the limit of processes: the caller must get an answer
            self._end_unsaved(token, reading, error)

    def _save(self, token: Future | None, reading: RecordReading) -> None:
        kind = reading.record.kind
        try:
            folder = Path(self._values()["record_directory"]).expanduser()
            path = folder / lois_ecu_records.file_name(kind, time.time())
            saved = lois_ecu_records.save(reading, path, partial(self._is_current, token))
        except Exception as error:  # the caller must get an answer
            self._end_unsaved(token, reading, f"{error}; {CHECK_FOLDER}")
            return
        if saved:
            if remark := lois_ecu_records.remark(reading):
                self._node.get_logger().warning(remark)
            self._end(token, True, str(path.absolute()))

    def _end_unsaved(self, token: Future | None, reading: RecordReading, error: object) -> None:
        name = NAMES[reading.record.kind]
        self._end(token, False, f"the {name} was received, but could not be saved: {error}")

    def _is_current(self, token: Future | None) -> bool:
        return bool(self._link.call(lambda session, _now: session.task_is_current(token)))

    def _end(self, token: Future | None, success: bool, message: str) -> None:
        self._link.call(lambda session, _now: session.end_task(token, success, message))
