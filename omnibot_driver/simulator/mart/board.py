# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The simulated controller as a simulated board: two channels of datagrams, and time in ticks.

This module knows the server and the boards' interface; it does not know commands.
"""

from collections.abc import Mapping

from omnibot_driver.simulator.common.board import Channel, Packet
from omnibot_driver.simulator.mart.server import MartServer
from omnibot_driver.simulator.mart.settings import MartSettings

CHANNELS = (Channel("command", datagrams=True), Channel("stop", "", datagrams=True))
TICK_S = 0.002


class SimulatedMart:
    """A simulated MART controller with the common interface of simulated boards.

    ``server``: the controller with its robot. It holds all state except ``ticks``.
    """

    channels, tick_s = CHANNELS, TICK_S

    def __init__(self, settings: MartSettings | None = None) -> None:
        self.server = MartServer(settings)
        self.ticks = 0

    @property
    def now_s(self) -> float:
        """Simulated time since construction, in s."""
        return self.ticks * TICK_S

    def receive(self, data: bytes, now: float, channel: int = 0) -> None:
        """Deliver a datagram to the port ``channel`` at the simulated time. ``now`` is ignored."""
        self.server.receive(data, channel, None, self.now_s)

    def advance(self) -> list[Packet]:
        """Advance by one tick. Return the replies that are sent in it."""
        self.ticks += 1
        return [(reply.port, reply.data) for reply in self.server.advance(self.now_s)]

    def reboot(self) -> None:
        """Switch the controller off and on. The robot stays where it is."""
        self.server.power_cycle()

    @property
    def facts(self) -> Mapping[str, object]:
        """Facts about the robot and its controller, by name."""
        server, chassis = self.server, self.server.chassis
        motion = server.motion
        return {
            "x_m": chassis.x_m,
            "y_m": chassis.y_m,
            "yaw_rad": chassis.yaw_rad,
            "speed_mps": (chassis.right_mps + chassis.left_mps) / 2,
            "yaw_rate_radps": (chassis.right_mps - chassis.left_mps) / server.settings.track_m,
            "way_m": chassis.way_m,
            "moving": server.moving,
            "motion": None if motion is None else motion.name.lower(),
            "encoder": chassis.encoder,
            "registers": [chassis.right, chassis.left],
            "volts": chassis.volts,
            "imu": server.imu.plugged(server.now_s),
            "hit_wall": server.hit_wall,
            "hung": server.hung,
            "stop_port_hung": server.stop_port_hung,
            "blocked": server.blocked,
            "crashed": server.crashed,
            "executed": len(server.executed),
        }
