# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A toy board: requests over UDP, and one blocking move at a time.

``WHERE``: the reply ``at WAY TURN`` is the motion since the previous ``WHERE``, in mm and mrad.

``MOVE V W``: move at V mm/s and W mrad/s for 0.2 s, then reply ``ok``.

``HALT``, on the next higher port: end a move at once.
"""

import math
import re
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from omnibot_driver.core.board import Board, Mode
from omnibot_driver.core.commands.actuator import Wanted
from omnibot_driver.core.commands.orders import Drive, EmergencyStop, Order, Stop
from omnibot_driver.core.commands.set_points import Authority
from omnibot_driver.core.commands.stop_proof import StopProof
from omnibot_driver.core.geometry.differential import DifferentialKinematics
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.packets import NO_PACKETS, Packets, packed
from omnibot_driver.core.readings import DisplacementReading, Reading
from omnibot_driver.core.traits import Traits
from omnibot_driver.parameters import table
from omnibot_driver.transports import Transport
from omnibot_driver.transports.udp import UdpPorts, check_address

POLL_S, ANSWER_S, HALT_S = 0.1, 1.0, 0.05
HALT = packed(b"HALT", 1)
AT = re.compile(rb"at (-?\d+) (-?\d+)")


class Moves:
    """The toy's actuator. It sends one move at a time, after the reply to the previous request."""

    rate_hz = 20.0
    commanded: BodyTwist | None = BodyTwist(0.0, 0.0, 0.0)

    def __init__(self, board: "RequestBoard", proof: StopProof) -> None:
        self._board, self._proof = board, proof
        self.connect()

    def is_zero(self, order: Order) -> bool:
        return not isinstance(order, Drive) or move(order.twist) == b"MOVE 0 0"

    def connect(self) -> None:
        self._wanted: Wanted = None
        self._halt_at = -math.inf

    def apply(self, wanted: Wanted, now: float) -> None:
        self._wanted, self._halt_at = wanted, min(self._halt_at, now)

    def wrote(self, packets: Packets, now: float) -> None:
        pass

    @property
    def wake_at(self) -> float:
        wanted = self._wanted
        if wanted is None:
            return math.inf
        if isinstance(wanted, Stop | EmergencyStop) or wanted.is_zero:
            return self._halt_at
        return self._board.answered_by if self._board.has_polled else math.inf

    def due(self, now: float) -> Packets:
        wanted = self._wanted
        if now < self.wake_at or wanted is None:
            return NO_PACKETS
        if isinstance(wanted, Stop | EmergencyStop) or wanted.is_zero:
            self._halt_at = now + HALT_S
            self._proof.stopped(now)
            self.commanded = BodyTwist(0.0, 0.0, 0.0)
            return HALT
        order = wanted.order(now)
        assert isinstance(order, Drive)
        self._proof.moved()
        self.commanded = order.twist
        return self._board.ask(move(order.twist), now)


class RequestBoard(Board):
    traits = Traits(
        channels=("command", "halt"),
        imu_period_s=None,
        authorities=frozenset({Authority.BASE}),
        requests=frozenset(),
        unheard_s=1.0,
        silence_s=1.5,
        baudrate=False,
    )
    settings: Any = None
    mode = Mode.UNKNOWN

    def connect(self) -> None:
        self.mode, self.answered_by, self._poll_at = Mode.UNKNOWN, -math.inf, -math.inf
        self._seen_at: float | None = None
        self.has_polled = False

    def receive(self, data: bytes, now: float, channel: int = 0) -> list[Reading]:
        self.answered_by = -math.inf
        self.mode = Mode.NOMINAL
        if not (found := AT.fullmatch(data)):
            return []
        way, turn = (int(number) / 1e3 for number in found.groups())
        before, self._seen_at = self._seen_at, now
        seconds = None if before is None else now - before
        return [DisplacementReading(way, 0.0, turn, "body", seconds, 0)]

    def silence(self) -> None:
        self.mode = Mode.UNKNOWN

    def ask(self, words: bytes, now: float) -> Packets:
        self.answered_by, self.has_polled = now + ANSWER_S, words == b"WHERE"
        return packed(words)

    @property
    def wake_at(self) -> float:
        return max(self._poll_at, self.answered_by)

    def due(self, now: float) -> Packets:
        if now < self.wake_at:
            return NO_PACKETS
        self._poll_at = now + POLL_S
        return self.ask(b"WHERE", now)

    def actuator(self, proof: StopProof) -> Moves:
        return Moves(self, proof)

    def wake(self) -> Packets:
        return HALT

    def stop(self) -> Packets:
        return HALT


def move(twist: BodyTwist) -> bytes:
    return b"MOVE %d %d" % (round(1e3 * twist.vx_mps), round(1e3 * twist.yaw_rate_radps))


SIMULATOR = "toys.request_robot"
PARAMETERS = table(
    "request_board",
    RequestBoard.traits,
    changed={"port": {"default": "udp://127.0.0.1:5000"}},
)


def make(values: Mapping[str, Any]) -> RequestBoard:
    return RequestBoard()


def settings(values: Mapping[str, Any]) -> object:
    return None


def kinematics(values: Mapping[str, Any]) -> DifferentialKinematics:
    return DifferentialKinematics(wheel_radius_m=0.1, track_m=0.4)


def opener(values: Mapping[str, Any]) -> Callable[[], Transport]:
    check_address(values["port"], 2)
    return partial(UdpPorts, values["port"], 2)


def extras(node: Any, link: Any, values: Mapping[str, Any]) -> Mapping[type, Any]:
    return {}
