# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Profile of a board with few features: two wheels and ``cmd_vel``, but no IMU and no pause.

A simulated OmniBot serves as the board. The profile adds the topic ``heard`` and the service
``~/ask``.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

from rclpy.node import Node
from std_msgs.msg import Int64
from std_srvs.srv import Trigger

from omnibot_driver.core.board import BoardFigures
from omnibot_driver.core.commands.set_points import Authority
from omnibot_driver.core.geometry.differential import DifferentialKinematics
from omnibot_driver.core.omnibot import OmniBot, OmniBotSettings
from omnibot_driver.core.readings import ImuReading, Reading
from omnibot_driver.core.requests import Request
from omnibot_driver.parameters import Parameter, table
from omnibot_driver.transports.serial_port import SerialPort

TRAITS: Final = replace(
    OmniBot.traits,
    imu_period_s=None,
    authorities=frozenset({Authority.BASE}),
    requests=frozenset({Request.START}),
    wheels=(),
)
TRACK: Final = Parameter("track_width", 0.3, "m", "From wheel to wheel.", low=0.1, high=1.0)
NAMES: Final = Parameter("names", ["a"], "", "Names of things.", length=(0, 3), fixed=True)
GAIN: Final = Parameter("gain", 1.0, "1", "Kept by the board.", low=0.0, high=9.0, unset=True)
PARAMETERS: Final = table(
    "plain",
    TRAITS,
    own={"The plain board": (TRACK, NAMES, GAIN)},
    changed={"port": {"default": "/dev/ttyACM7"}, "max_linear_speed": {"default": 0.2}},
)


class PlainBoard(OmniBot):
    """A board with the protocol of the OmniBot, without its IMU readings."""

    traits = TRAITS

    def receive(self, data: bytes, now: float, channel: int = 0) -> list[Reading]:
        readings = super().receive(data, now)
        return [reading for reading in readings if not isinstance(reading, ImuReading)]

    @property
    def figures(self) -> BoardFigures:
        rates_hz = {name: hz for name, hz in super().figures.rates_hz.items() if name != "IMU"}
        return replace(super().figures, rates_hz=rates_hz)


@dataclass(frozen=True, slots=True)
class Heard:
    """A reading that only the plain board has."""

    times: int


def make(values: Mapping[str, Any]) -> PlainBoard:
    return PlainBoard(settings(values))


def settings(_values: Mapping[str, Any]) -> OmniBotSettings:
    return OmniBotSettings()


def opener(values: Mapping[str, Any]) -> Callable[[], SerialPort]:
    return partial(SerialPort, values["port"], 115200)


def kinematics(values: Mapping[str, Any]) -> DifferentialKinematics:
    return DifferentialKinematics(0.05, values["track_width"])


def extras(
    node: Node, link: Any, _values: Mapping[str, Any]
) -> Mapping[type, Callable[[Any, int], None]]:
    publisher = node.create_publisher(Int64, "heard", 10)

    def ask(_request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.message = link.call(lambda session, _now: session.state)
        response.success = True
        return response

    node.create_service(Trigger, "~/ask", ask)
    return {Heard: lambda heard, _stamp_ns: publisher.publish(Int64(data=heard.times))}
