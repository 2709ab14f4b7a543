# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Helpers that start the driver with a simulated Fejemis, and drive the robot."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from driver_process import Driver
from probe import Probe
from two_ports import TwoPorts

from omnibot_driver.simulator.fejemis import FejemisSettings, SimulatedFejemis

Start = Callable[..., Any]


def robot_of(stack: ExitStack, folder: Path, **settings: Any) -> TwoPorts:
    board = SimulatedFejemis(FejemisSettings(**settings))
    return stack.enter_context(TwoPorts(board, folder))


def started(robot: TwoPorts, start_driver: Start, **parameters: object) -> Driver:
    port, front_port = robot.ports
    driver: Driver = start_driver(port, board="fejemis", front_port=front_port, **parameters)
    return driver


@contextmanager
def driven(probe: Probe, robot: TwoPorts, vx: float = 0.3, yaw: float = 0.0) -> Iterator[None]:
    """Command a velocity at 10 Hz, wait until the robot moves, then run the caller's block.

    The commands continue until the block ends. ``vx`` is in m/s, and ``yaw`` in rad/s.
    """
    with probe.commanding(vx, yaw):
        robot.wait_until(lambda board: not board.standing)
        yield


def moves_again(probe: Probe, robot: TwoPorts) -> None:
    """Command the robot until it moves, then wait until it is at rest. Fail if it does not move."""
    with driven(probe, robot):
        pass
    robot.stands_for_good()
