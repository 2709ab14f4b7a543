# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What the demo must know about a board, from the board's profile.

This module must not name a board, and must not use ROS or processes.
"""

from dataclasses import dataclass

from omnibot_driver import boards
from omnibot_driver.core.commands.set_points import Authority
from omnibot_driver.core.errors import ParameterError
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.simulator.common import options


@dataclass(frozen=True, slots=True, kw_only=True)
class Capability:
    """What the demo needs to know about a board that accepts ``cmd_vel``.

    ``title``: name of the board, for the sentence "A simulated ... drives".
    ``imu``, ``sideways``: whether the board has an IMU, and whether the robot can drive sideways.
    ``ports``: names of the driver's parameters for the addresses that the simulator prints, in the
    same order. A name is empty if the driver derives the address from another one.
    ``real``: arguments of the driver for the real robot.
    ``page``: path of the document about the board.
    """

    title: str
    imu: bool
    sideways: bool
    ports: tuple[str, ...]
    real: str
    page: str


def of(name: str) -> Capability:
    """Return what the board with this name can do.

    Raises ParameterError for an unknown board, and for a board that does not accept ``cmd_vel``.
    """
    values = boards.check_all({"board": name})
    profile = boards.load(name)
    traits = profile.make(values).traits
    if Authority.BASE not in traits.authorities:
        raise ParameterError(f"the board {name} does not accept cmd_vel, so it has no demo")
    simulator = options.load(profile.SIMULATOR)
    ports = tuple(channel.parameter for channel in simulator.CHANNELS)
    sideways = profile.kinematics(values).feasible(BodyTwist(0.0, 1.0, 0.0)).vy_mps != 0.0
    return Capability(
        title=simulator.TITLE,
        imu=bool(traits.imu),
        sideways=sideways,
        ports=ports,
        real=port_arguments(name, {port: str(values[port]) for port in ports if port}),
        page=f"docs/boards/{name}.md",
    )


def port_arguments(name: str, ports: dict[str, str]) -> str:
    """Return the arguments after ``--ros-args`` with which the driver is started for this board.

    ``ports``: addresses of the ports, by the name of the port's parameter.
    """
    board = {} if name == options.DEFAULT_BOARD else {"board": name}
    return " ".join(f"-p {key}:={value}" for key, value in {**board, **ports}.items())
