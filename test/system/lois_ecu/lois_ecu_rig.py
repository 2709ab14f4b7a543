# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A simulated LOIS ECU that runs in real time. The driver opens its pseudo-terminal."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any, Final

from probe import Probe
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters

from omnibot_driver.simulator.common.serving import PtyBoard
from omnibot_driver.simulator.lois_ecu import QUIRKS, LoisSettings, SimulatedLois

PATIENCE_S: Final = 30.0
NODE: Final = "omnibot_driver"


class Ecu:
    """A simulated LOIS ECU that runs in real time."""

    def __init__(self, firmware: Any, served: "PtyBoard[SimulatedLois]") -> None:
        self.firmware, self.served = firmware, served

    @property
    def path(self) -> str:
        return self.served.path

    def wait_for(self, predicate: Callable[[SimulatedLois], object]) -> None:
        assert self.served.wait_for(lambda board: bool(predicate(board)), PATIENCE_S), list(
            self.served.board.commands
        )[-20:]

    def do(self, action: Callable[[SimulatedLois], object]) -> Any:
        with self.served.lock:
            return action(self.served.board)

    def stands_for_good(self) -> None:
        """Wait until the robot has been at rest for 0.8 s.

        By default, ``cmd_vel_timeout`` is shorter than this. So no earlier command is still in
        effect.
        """
        since: list[int] = []

        def stood(board: SimulatedLois) -> bool:
            if not board.standing:
                since.clear()
                return False
            since.append(board.tick)
            return since[-1] - since[0] >= 80

        self.wait_for(stood)


def ecu_of(firmware: Any, stack: ExitStack, **settings: Any) -> Ecu:
    board = SimulatedLois(LoisSettings(quirks=QUIRKS[firmware], **settings))
    return Ecu(firmware, stack.enter_context(PtyBoard(board)))


@contextmanager
def driven(probe: Probe, ecu: Ecu, vx: float = 0.3, yaw: float = 0.0) -> Iterator[None]:
    """Command a velocity at 10 Hz until the context ends.

    The body of the context begins when the robot moves. ``vx`` is in m/s, and ``yaw`` in rad/s.
    """
    with probe.commanding(vx, yaw):
        ecu.wait_for(lambda board: not board.standing)
        yield


def set_parameter(probe: Probe, name: str, value: str | float) -> None:
    """Set a parameter of the running driver. A number is sent as a double."""
    if isinstance(value, str):
        given = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=value)
    else:
        given = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=float(value))
    request = [Parameter(name=name, value=given)]
    (result,) = probe.call(SetParameters, "set_parameters", parameters=request).results
    assert result.successful, result.reason
