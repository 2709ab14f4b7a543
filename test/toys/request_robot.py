# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The simulated robot of the toy board that obeys requests over UDP."""

import argparse

from omnibot_driver.simulator.common.board import Channel, Packet

TITLE = "toy of requests"
CHANNELS = (Channel("command", datagrams=True), Channel("halt", "", datagrams=True))
TICK_S = 0.01


class RequestRobot:
    """A robot that handles one request at a time. Later requests wait until it has finished."""

    channels, tick_s = CHANNELS, TICK_S

    def __init__(self) -> None:
        self.heard: list[bytes] = []
        self.way_m = self.turn_rad = 0.0
        self._waiting: list[bytes] = []
        self._speed, self._left = (0, 0), 0
        self._told = (0, 0)

    def receive(self, data: bytes, now: float, channel: int) -> None:
        self.heard.append(data)
        if channel == 1:
            self._left, self._speed = min(self._left, 1), (0, 0)
        else:
            self._waiting.append(data)

    def advance(self) -> list[Packet]:
        v, w = self._speed
        self.way_m, self.turn_rad = self.way_m + v / 1e5, self.turn_rad + w / 1e5
        if self._left:
            self._left -= 1
            if self._left:
                return []
            self._speed = (0, 0)
            return [(0, b"ok")]
        if not self._waiting:
            return []
        word, *numbers = self._waiting.pop(0).split()
        if word == b"MOVE":
            self._speed, self._left = (int(numbers[0]), int(numbers[1])), 20
            return []
        before, self._told = self._told, (round(1e3 * self.way_m), round(1e3 * self.turn_rad))
        way, turn = (now - then for now, then in zip(self._told, before, strict=True))
        return [(0, b"at %d %d" % (way, turn))]

    @property
    def stands(self) -> bool:
        return self._speed == (0, 0)

    def reboot(self) -> None:
        self.__init__()  # type: ignore[misc]

    @property
    def facts(self) -> dict[str, object]:
        return {"x_m": self.way_m, "y_m": 0.0, "yaw_rad": self.turn_rad}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add nothing: this board has only the common options."""


def from_arguments(arguments: argparse.Namespace) -> RequestRobot:
    return RequestRobot()
