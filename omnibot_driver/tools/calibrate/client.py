# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A ROS client of the running driver: its parameters and its services.

This module knows parameters and services; it does not know how the robot moves.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from std_srvs.srv import SetBool, Trigger

from omnibot_driver import boards
from omnibot_driver.parameters import Table, Value
from omnibot_driver.tools.calibrate.interruption import Interruption
from omnibot_driver.tools.drivers import discovery_advice, running_drivers
from omnibot_driver.tools.needs import ToolError

FOUND_WITHIN_S: Final = 5.0
ANSWER_WITHIN_S: Final = 12.0
REQUESTS: Final = 3
"""Number of times that the tool sends a request that may be repeated. The middleware drops an
answer if the driver discovers the new client too late."""
SPIN_S: Final = 0.005
"""Time, in s, for which each call of the executor waits. All calls must use the same time: with
another time, rclpy begins its round of callbacks again, and a busy computer may never process the
e-stop's messages."""


class Client:
    """A ROS client of one running driver.

    ``driver``: the full name of the driver's node.

    ``parameters``, ``table``: values and descriptions of the driver's parameters, by name.
    """

    def __init__(self, node: Node, context: Context, interruption: Interruption) -> None:
        self._node, self._interruption = node, interruption
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(node)
        self.driver = self._find()
        self.table = self._table()
        self.parameters = self._get_parameters([row.name for row in self.table.rows])

    def _find(self) -> str:
        here: list[str] = []

        def look() -> list[str]:
            here[:] = self._here()
            return here

        if self._wait(look, FOUND_WITHIN_S):
            return here[0]
        if not (others := running_drivers(self._node)):
            raise ToolError(
                "no driver is running: start one (ros2 run omnibot_driver driver), or set"
                f" ROS_DOMAIN_ID to the value that the driver uses{discovery_advice()}"
            )
        own = self._namespace()
        place = f"in the namespace {own}" if own else "without a namespace"
        raise ToolError(
            f"no driver is running {place}, but these drivers run elsewhere: {', '.join(others)};"
            " choose one with --namespace"
        )

    def _require_alone(self) -> None:
        """Raise ToolError if two drivers share the namespace, because both would obey commands."""
        here = [
            name
            for name in self._here()
            for _ in self._node.get_publishers_info_by_topic(f"{name}/state")
        ]
        if len(here) > 1:
            raise ToolError(
                f"there are several drivers in this namespace: {', '.join(here)}; end all but one"
            )

    def _here(self) -> list[str]:
        return [
            name
            for name in running_drivers(self._node)
            if name.rpartition("/")[0] == self._namespace()
        ]

    def _namespace(self) -> str:
        return self._node.get_namespace().rstrip("/")

    def _table(self) -> Table:
        board = self._get_parameters(["board"])["board"]
        if board not in boards.PROFILES:
            raise ToolError(
                f"{self.driver} drives a board {board}, which this tool does not know; update the"
                " tool"
            )
        return boards.load(str(board)).PARAMETERS

    def _get_parameters(self, names: Sequence[str]) -> dict[str, Value]:
        request = GetParameters.Request(names=names)
        answer = self._call(GetParameters, f"{self.driver}/get_parameters", request, REQUESTS)
        values = [parameter_value_to_python(value) for value in answer.values]
        if len(values) != len(names):
            self._require_alone()  # the answer may be that of another board's driver
            raise ToolError(
                f"{self.driver} and this tool have different versions; update the older one"
            )
        return {
            name: list(value) if isinstance(value, Sequence) and type(value) is not str else value
            for name, value in zip(names, values, strict=True)
        }

    def set_parameters(self, values: Mapping[str, Value]) -> None:
        """Set parameters of the running driver. Raises ToolError if the driver rejects a value."""
        messages = [
            Parameter(name, value=value).to_parameter_msg() for name, value in values.items()
        ]
        request = SetParameters.Request(parameters=messages)
        answer = self._call(SetParameters, f"{self.driver}/set_parameters", request, REQUESTS)
        for name, result in zip(values, answer.results, strict=True):
            if not result.successful:
                raise ToolError(f"the driver refuses {name}: {result.reason}")
        self.parameters.update(values)

    def restore_parameters(self, values: Mapping[str, Value]) -> None:
        """Set parameters as ``set_parameters`` does, even after the user has pressed ctrl-C."""
        with self._interruption.deferred():
            self.set_parameters(values)

    def apply(self, values: Mapping[str, Value]) -> None:
        """Set the parameters in ``values``, except those that cannot change in a running driver."""
        changeable = {
            name: value for name, value in values.items() if not self.table.by_name[name].fixed
        }
        if changeable:
            self.set_parameters(changeable)

    def call(self, service: str, on: bool | None = None) -> str:
        """Call a service of the driver, and return the message in its response.

        ``on``: the value for SetBool; None for a Trigger. Raises ToolError if the driver reports a
        failure.
        """
        kind = Trigger if on is None else SetBool
        request = Trigger.Request() if on is None else SetBool.Request(data=on)
        answer = self._call(kind, f"{self.driver}/{service}", request)
        if not answer.success:
            raise ToolError(f"~/{service}: {answer.message}")
        return str(answer.message)

    def _call(self, kind: Any, name: str, request: Any, times: int = 1) -> Any:
        """Call a service, and return its answer. Raises ToolError if none comes.

        ``times``: number of times that the request is sent if no answer comes.
        """
        client = self._node.create_client(kind, name)
        try:
            if not self._wait(client.service_is_ready, FOUND_WITHIN_S):
                raise ToolError(f"{name} is not available; check that the driver still runs")
            for _ in range(times):
                future = client.call_async(request)
                if self._wait(future.done, ANSWER_WITHIN_S / times):
                    return future.result()
            raise ToolError(f"{name} does not answer; check that the driver still runs")
        finally:
            self._node.destroy_client(client)

    def _wait(self, done: Callable[[], object], seconds: float) -> bool:
        """Wait up to ``seconds`` until ``done`` returns a true value; return False on timeout."""
        deadline_s = time.monotonic() + seconds
        while not (held := done()) and time.monotonic() < deadline_s:
            self._spin(0.05)
        return bool(held)

    def _spin(self, seconds: float) -> None:
        self._interruption.check()
        self._hear(seconds)

    def _hear(self, seconds: float) -> None:
        deadline_s = time.monotonic() + seconds
        while time.monotonic() < deadline_s:
            self._executor.spin_once(timeout_sec=SPIN_S)
