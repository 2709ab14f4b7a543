# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A simulated toy board with two serial channels: one for its drive, one for a steered wheel.

Input: ``go V W`` in m/s and rad/s, ``angle DEGREES``.

Output: the pose ``odo X Y YAW`` in m and rad every 400 ms, and the angle of the steered wheel,
``fwl DEGREES``, every 20 ms.
"""

import argparse
import math

from omnibot_driver.simulator.common.board import Channel, Packet

TITLE = "toy"
DRIVE, FRONT = 0, 1
CHANNELS = (Channel("drive"), Channel("front", "front_port"))


class ToyLines:
    """A board with two serial lines. ``seed`` is stored, but has no effect."""

    channels, tick_s = CHANNELS, 0.02

    def __init__(self, seed: int = 0, angle: float = 0.0) -> None:
        self.seed, self.angle_deg = seed, angle
        self.tick, self.pose, self.twist = 0, (0.0, 0.0, 0.0), (0.0, 0.0)
        self._held = [b"", b""]

    def receive(self, data: bytes, now: float, channel: int) -> None:
        *lines, self._held[channel] = (self._held[channel] + data).split(b"\n")
        for word, *numbers in (line.split() for line in lines):
            if (channel, word) == (DRIVE, b"go"):
                self.twist = (float(numbers[0]), float(numbers[1]))
            elif (channel, word) == (FRONT, b"angle"):
                self.angle_deg = float(numbers[0])

    def advance(self) -> list[Packet]:
        self.tick += 1
        (x, y, yaw), (v, w) = self.pose, self.twist
        way = v * self.tick_s
        self.pose = (x + way * math.cos(yaw), y + way * math.sin(yaw), yaw + w * self.tick_s)
        packets = [(FRONT, b"fwl %.0f\n" % self.angle_deg)]
        if self.tick % 20 == 0:
            packets.append((DRIVE, b"odo %.3f %.3f %.3f\n" % self.pose))
        return packets

    def reboot(self) -> None:
        self.twist = (0.0, 0.0)

    @property
    def facts(self) -> dict[str, object]:
        return {**dict(zip(("x_m", "y_m", "yaw_rad"), self.pose, strict=True)), "tick": self.tick}


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--angle", type=float, default=0.0, help="initial angle of the steered wheel"
    )


def from_arguments(arguments: argparse.Namespace) -> ToyLines:
    return ToyLines(arguments.seed, arguments.angle)
