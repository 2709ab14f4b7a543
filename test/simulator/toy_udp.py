# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A simulated toy board that answers requests over UDP and executes one move at a time.

* ``odo``: the answer is ``ok X``, with the position X in m.
* ``move D``: after a drive of D m at 0.5 m/s, the answer is ``ok X``.
* ``stop``: the answer is ``ok``, and the move's answer is ``fail stopped``.
"""

import argparse

from omnibot_driver.simulator.common.board import Channel, Packet

TITLE = "toy server"
CHANNELS = (Channel(datagrams=True),)


class ToyServer:
    """A server that executes one move at a time. ``requests`` holds all datagrams received."""

    channels, tick_s = CHANNELS, 0.01

    def __init__(self) -> None:
        self.requests: list[bytes] = []
        self.x_m = 0.0
        self._left_m: float | None = None
        self._answers: list[bytes] = []

    def receive(self, data: bytes, now: float, channel: int) -> None:
        self.requests.append(data)
        match data.split():
            case [b"odo"]:
                self._answers.append(b"ok %.3f" % self.x_m)
            case [b"move", distance] if self._left_m is None:
                self._left_m = float(distance)
            case [b"stop"] if self._left_m is not None:
                self._left_m = None
                self._answers += [b"fail stopped", b"ok"]
            case _:
                self._answers.append(b"fail")

    def advance(self) -> list[Packet]:
        if self._left_m is not None:
            step_m = min(0.5 * self.tick_s, self._left_m)
            self.x_m += step_m
            self._left_m -= step_m
            if not self._left_m:
                self._left_m = None
                self._answers.append(b"ok %.3f" % self.x_m)
        answers, self._answers = self._answers, []
        return [(0, answer) for answer in answers]

    def reboot(self) -> None:
        self._left_m = None

    @property
    def facts(self) -> dict[str, object]:
        return {"x_m": self.x_m, "y_m": 0.0, "yaw_rad": 0.0}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add nothing: this board has only the common options."""


def from_arguments(arguments: argparse.Namespace) -> ToyServer:
    return ToyServer()
