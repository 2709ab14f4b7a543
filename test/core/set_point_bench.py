# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Test bench for a stream of set-points. Short texts such as ``go`` stand for the frames."""

from typing import Any

from omnibot_driver.core.commands.orders import EMERGENCY_STOP, Order
from omnibot_driver.core.commands.orders import STOP as STAND
from omnibot_driver.core.commands.policy import (
    CommandPolicy,
    CommandSettings,
)
from omnibot_driver.core.commands.set_point_stream import SetpointStream
from omnibot_driver.core.commands.set_points import Authority, SteadySetpoint
from omnibot_driver.core.commands.stop_proof import StopProof
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.packets import Packets, joined, packed

STOP, ESTOP, GO, TURN = b"stop", b"estop", b"go", b"turn"


BOTH = ESTOP + STOP


TIMEOUT_S = 0.5


class Words:
    """A substitute for the code that turns orders into packets. Orders can be bytes.

    The bytes are returned unchanged.
    """

    def stop(self) -> Packets:
        return packed(STOP)

    def emergency_stop(self) -> Packets:
        return packed(ESTOP)

    def encode(self, order: Order | bytes) -> Packets:
        if isinstance(order, bytes):
            return packed(order)
        return packed(ESTOP if order is EMERGENCY_STOP else STOP)

    def meaning(self, packets: Packets) -> BodyTwist:
        return BodyTwist(0.0, 0.0, 0.0)


class Stream(CommandPolicy):
    """A command policy, which decides when to write set-points. The set-points are texts."""

    def __init__(self, settings: CommandSettings) -> None:
        proof = StopProof()
        self.actuator = SetpointStream(Words(), proof)
        super().__init__(settings, self.actuator, proof)

    def write(self, now: float) -> bytes:
        return joined(self.due(now))


def order(stream: Stream, frame: bytes, now: float, authority: Authority = Authority.BASE) -> None:
    wanted: Any = STAND if frame == STOP else frame
    setpoint = SteadySetpoint(authority, wanted, stream.actuator.is_zero)
    stream.command(setpoint, now, expires_at=now + TIMEOUT_S)


def make_stream() -> Stream:
    return Stream(CommandSettings(timeout_s=TIMEOUT_S, rate_hz=20.0))


def run(stream: Stream, start: float, end: float) -> list[tuple[float, bytes]]:
    """Write the stream's set-points from ``start`` to ``end``, each when it is due.

    Return the time and the bytes of each write.
    """
    written = []
    now = start
    while now <= end:
        frame = stream.write(now)
        if frame:
            written.append((now, frame))
        assert stream.wake_at > now, "the pacer would spin"
        now = stream.wake_at
    return written
