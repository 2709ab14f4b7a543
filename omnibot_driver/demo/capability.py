# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What the demo has to know of a kind of board: asked of its profile, once, before anything starts.

Must not know any board, ROS or processes.
"""

from dataclasses import dataclass

from omnibot_driver import boards
from omnibot_driver.core.commands.set_points import Authority
from omnibot_driver.core.errors import ParameterError
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.simulator.common import options


@dataclass(frozen=True, slots=True, kw_only=True)
class Capability:
    """Of a board that drives by ``cmd_vel`` and has ``odom``.

    title: as in "A simulated ... drives". imu: it has ``imu/data_raw``. sideways: it moves along
    y as well. ports: by line that the simulator prints, the driver's parameter, empty where it
    follows from another. real: arguments that a driver needs for the real robot.
    """

    title: str
    imu: bool
    sideways: bool
    ports: tuple[str, ...]
    real: str


def of(name: str) -> Capability:
    """That of a board by its name. Raises ParameterError where it is not built, or cannot drive."""
    values = boards.check_all({"board": name})
    profile = boards.load(name)
    traits = profile.make(values).traits
    if Authority.BASE not in traits.authorities:
        raise ParameterError(f"the board {name} takes no cmd_vel, so it has no demo")
    simulator = options.load(profile.SIMULATOR)
    ports = tuple(channel.parameter for channel in simulator.CHANNELS)
    sideways = profile.kinematics(values).feasible(BodyTwist(0.0, 1.0, 0.0)).vy_mps != 0.0
    return Capability(
        title=simulator.TITLE,
        imu=bool(traits.imu),
        sideways=sideways,
        ports=ports,
        real=port_arguments(name, {port: str(values[port]) for port in ports if port}),
    )


def port_arguments(name: str, ports: dict[str, str]) -> str:
    """What follows ``--ros-args`` for this board, by the parameters that name its ports."""
    board = {} if name == options.DEFAULT_BOARD else {"board": name}
    return " ".join(f"-p {key}:={value}" for key, value in {**board, **ports}.items())
