# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The services in the node's own namespace, ``~/``.

While a service waits for its answer, it does not block other callbacks.
"""

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rclpy
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import SetBool, Trigger

from omnibot_driver import calibration
from omnibot_driver.core.errors import RequestRefused
from omnibot_driver.core.reporter import DISCONNECTED
from omnibot_driver.core.requests import Request, RequestDone
from omnibot_driver.core.session import Session
from omnibot_driver.core.traits import Traits
from omnibot_driver.link import Link
from omnibot_driver.qos import DEEP
from omnibot_driver.replay import Replay


async def ask(link: Any, question: Callable[[Session, Future, float], None], response: Any) -> Any:
    """Ask the session a question, wait for the answer, and return it in ``response``.

    ``question``: gets the session, the token of the request and the time in s, and raises
    RequestRefused with the reason for a refusal.
    """
    answer = Future()
    try:
        link.call(lambda session, now: question(session, answer, now))
    except RequestRefused as error:
        response.success, response.message = False, str(error)
        return response
    done: RequestDone = await answer
    response.success, response.message = done.success, done.message
    return response


class Services:
    """The services of one node, except those that only one kind of board has.

    ``calibration_file``: path of the file for the measured gyro bias; if empty, it is not saved.
    """

    def __init__(
        self, node: Node, link: Link | Replay, traits: Traits, calibration_file: str
    ) -> None:
        self._node, self._link = node, link
        self._calibration_file = calibration_file
        waiting = {"qos_profile": DEEP, "callback_group": ReentrantCallbackGroup()}
        node.create_service(SetBool, "~/estop", self._on_estop, qos_profile=DEEP)
        node.create_service(Trigger, "~/reset_odometry", self._on_reset_odometry, qos_profile=DEEP)
        if Request.START in traits.requests:
            node.create_service(Trigger, "~/start", self._on_start, **waiting)
        if Request.PAUSE in traits.requests:
            node.create_service(SetBool, "~/pause", self._on_pause, **waiting)
        if Request.RESET in traits.requests:
            node.create_service(Trigger, "~/reset", self._on_reset, **waiting)
        if traits.imu and not traits.calibrates_gyro:
            node.create_service(Trigger, "~/calibrate_gyro", self._on_calibrate_gyro, **waiting)

    def _on_estop(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        active = bool(request.data)
        try:
            state, response.message = self._link.call(
                lambda session, now: (
                    session.state,
                    session.estop(active, now, by="the service ~/estop"),
                )
            )
        except RequestRefused as error:
            response.success, response.message = False, str(error)
            return response
        if active and state != DISCONNECTED and self._link.blocked:
            response.message = (
                "e-stop latched; the port is not accepting data; the driver will open the port"
                " again and then send the stop"
            )
        response.success = True
        return response

    def _on_reset_odometry(
        self, _request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        try:
            self._link.call(lambda session, now: session.reset_odometry(now))
        except RequestRefused as error:
            response.success, response.message = False, str(error)
        else:
            response.success, response.message = True, "odometry set to zero"
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
        await ask(self._link, Session.calibrate_gyro, response)
        if response.success:
            bias = list(self._link.call(lambda session, _now: session.gyro_bias))
            self._node.set_parameters([rclpy.Parameter("gyro_bias", value=bias)])
            if self._calibration_file:
                await self._save(Path(self._calibration_file).expanduser(), bias, response)
        return response

    async def _save(self, file: Path, bias: list[float], response: Trigger.Response) -> None:
        """Save the gyro bias on a separate thread, because a slow disk must not delay callbacks."""
        answer = Future()

        def save() -> None:
            try:
                calibration.save(file, {"gyro_bias": bias})
                answer.set_result("")
            except Exception as error:  # the caller must get an answer
                answer.set_result(str(error) or repr(error))
            if self._node.executor is not None:
                self._node.executor.wake()

        try:
            threading.Thread(target=save, name="omnibot-save", daemon=True).start()
        except RuntimeError as error:  # the limit of processes: the caller must get an answer
            answer.set_result(str(error))
        trouble = await answer
        if trouble:
            response.success = False
            response.message += f"; it is applied, but not saved: {trouble}"
        else:
            response.message += f"; saved to {file}"

    async def _request(self, request: Request, response: Any) -> Any:
        return await ask(
            self._link, lambda session, answer, now: session.request(request, answer, now), response
        )
