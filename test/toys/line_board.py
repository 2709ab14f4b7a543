# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A toy board: two serial lines of text, two wheels, and no IMU.

The line ``drive`` receives ``v LEFT RIGHT``, in mm/s. Every 0.4 s, the line ``sense`` sends
``d WAY TURN``: the motion since the previous message, in mm and mrad.
"""

import re
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from omnibot_driver.core.board import Board, Mode
from omnibot_driver.core.commands.orders import Drive, Order, TurnWheels
from omnibot_driver.core.commands.set_point_stream import SetpointStream
from omnibot_driver.core.commands.set_points import Authority
from omnibot_driver.core.commands.stop_proof import StopProof
from omnibot_driver.core.geometry.differential import DifferentialKinematics
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.packets import Packets, packed
from omnibot_driver.core.readings import DisplacementReading, Reading
from omnibot_driver.core.traits import Traits
from omnibot_driver.parameters import Parameter, table
from omnibot_driver.transports import Transport
from omnibot_driver.transports.serial_address import check_address
from omnibot_driver.transports.serial_port import SerialPort
from omnibot_driver.transports.several import Several

PERIOD_S = 0.4
WHEELS = DifferentialKinematics(wheel_radius_m=0.1, track_m=0.4)
STOP = packed(b"v 0 0\n")
LINE = re.compile(rb"d (-?\d+) (-?\d+)")


class LineBoard(Board):
    traits = Traits(
        channels=("drive", "sense"),
        imu_period_s=None,
        authorities=frozenset({Authority.BASE, Authority.WHEELS}),
        requests=frozenset(),
        wheels=("left", "right"),
        unheard_s=1.0,
        silence_s=2.0,
        baudrate=False,
    )
    settings: Any = None
    mode = Mode.UNKNOWN

    def connect(self) -> None:
        self._held, self.mode = b"", Mode.UNKNOWN

    def receive(self, data: bytes, now: float, channel: int = 0) -> list[Reading]:
        *lines, self._held = (self._held + data).split(b"\n")
        found = [LINE.fullmatch(line) for line in lines] if channel == 1 else []
        pairs = [[int(number) / 1e3 for number in match.groups()] for match in found if match]
        self.mode = Mode.NOMINAL if pairs else self.mode
        return [DisplacementReading(way, 0.0, turn, "body", PERIOD_S, 0) for way, turn in pairs]

    def silence(self) -> None:
        self.mode = Mode.UNKNOWN

    def actuator(self, proof: StopProof) -> SetpointStream:
        return SetpointStream(self, proof)

    def wake(self) -> Packets:
        return packed(b"\n") + self.stop()

    def stop(self) -> Packets:
        return STOP

    def encode(self, order: Order) -> Packets:
        rates: tuple[float, ...] = (0.0, 0.0)
        if isinstance(order, Drive):
            rates = WHEELS.wheel_rates(order.twist)
        elif isinstance(order, TurnWheels):
            rates = order.rates_radps
        left, right = (round(1e3 * rate * WHEELS.wheel_radius_m) for rate in rates)
        return packed(b"v %d %d\n" % (left, right))

    def meaning(self, packets: Packets) -> BodyTwist:
        _, left, right = packets[-1][1].split()
        radius_m = 1e3 * WHEELS.wheel_radius_m
        return WHEELS.body_twist((int(left) / radius_m, int(right) / radius_m))


SIMULATOR = "toys.line_robot"
PARAMETERS = table(
    "line_board",
    LineBoard.traits,
    own={"The toy": (Parameter("sense_port", "/dev/ttyACM1", "", "It tells.", fixed=True),)},
)


def make(values: Mapping[str, Any]) -> LineBoard:
    return LineBoard()


def settings(values: Mapping[str, Any]) -> object:
    return None


def kinematics(values: Mapping[str, Any]) -> DifferentialKinematics:
    return WHEELS


def opener(values: Mapping[str, Any]) -> Callable[[], Transport]:
    names = "port", "sense_port"
    for name in names:
        check_address(values[name], name, pollable=True)
    urls = {name: values[name] for name in names}
    return partial(
        Several, [(url, partial(SerialPort, url, 115200, name)) for name, url in urls.items()]
    )


def extras(node: Any, link: Any, values: Mapping[str, Any]) -> Mapping[type, Any]:
    return {}
