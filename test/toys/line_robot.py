# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The simulated robot of the toy board with two serial lines."""

import argparse
import re

from omnibot_driver.simulator.common.board import Channel, Packet

TITLE = "toy of two lines"
CHANNELS = (Channel("drive"), Channel("sense", "sense_port"))
TICK_S = 0.01
SET_POINT = re.compile(rb"v -?\d+ -?\d+")
"""Pattern of the lines that the robot obeys. Like a real board, it ignores all other lines."""


class LineRobot:
    """Two wheels that turn as commanded. The robot never stops by itself."""

    channels, tick_s = CHANNELS, TICK_S

    def __init__(self) -> None:
        self.tick = 0
        self.left = self.right = 0
        self.way_m = self.turn_rad = 0.0
        self.heard: list[bytes] = []
        self._held, self._told = b"", (0, 0)

    def receive(self, data: bytes, now: float, channel: int) -> None:
        *lines, self._held = (self._held + data).split(b"\n")
        for line in filter(SET_POINT.fullmatch, lines):
            self.heard.append(line)
            self.left, self.right = map(int, line.split()[1:])

    def advance(self) -> list[Packet]:
        self.tick += 1
        self.way_m += (self.left + self.right) / 2e3 * TICK_S
        self.turn_rad += (self.right - self.left) / 1e3 / 0.4 * TICK_S
        if self.tick % 40:
            return []
        before, self._told = self._told, (round(1e3 * self.way_m), round(1e3 * self.turn_rad))
        way, turn = (now - then for now, then in zip(self._told, before, strict=True))
        return [(1, b"d %d %d\n" % (way, turn))]

    @property
    def stands(self) -> bool:
        return self.left == self.right == 0

    def reboot(self) -> None:
        self.__init__()  # type: ignore[misc]

    @property
    def facts(self) -> dict[str, object]:
        return {"x_m": self.way_m, "y_m": 0.0, "yaw_rad": self.turn_rad}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add nothing: this board has only the common options."""


def from_arguments(arguments: argparse.Namespace) -> LineRobot:
    return LineRobot()
