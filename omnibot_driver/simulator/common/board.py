# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What a simulated board is to everything that runs, carries or chooses one.

Values and protocols only. Knows no board.
"""

import argparse
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

Packet = tuple[int, bytes]
"""Channel and bytes; one whole datagram where the channel carries datagrams."""


@dataclass(frozen=True, slots=True)
class Channel:
    """One connection between a board and the computer.

    name: of this channel among the board's; empty for the only one.
    parameter: the driver's parameter that names its port; empty where that follows from another
        channel's (the next UDP port).
    datagrams: UDP; otherwise a serial line.
    """

    name: str = ""
    parameter: str = "port"
    datagrams: bool = False


class SimulatedBoard(Protocol):
    """A board with its robot. Pure: the same settings and input give the same output."""

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The connections of the board; a packet names one by its index."""

    @property
    def tick_s(self) -> float:
        """The board time that passes with each ``advance``."""

    def receive(self, data: bytes, now: float, channel: int, /) -> None:
        """Take what was sent to the board: bytes of a serial line in any chunking, or one datagram.

        now: when it arrived, in seconds by any steady clock. What the board says to it comes out of
        the next ``advance``.
        """

    def advance(self) -> list[Packet]:
        """Let one tick pass; what the board sends in it, in its order."""

    def reboot(self) -> None:
        """Power-cycle the board; the robot stays where it truly is."""

    @property
    def facts(self) -> Mapping[str, object]:
        """What JSON can say of the robot and the board.

        Always with ``x_m``, ``y_m`` and ``yaw_rad``, the true pose since construction, unwrapped.
        """


class SimulatorModule(Protocol):
    """The names that the package of a simulated board must have."""

    TITLE: str
    """What it simulates, as in "A simulated ... board listens on"."""
    CHANNELS: tuple[Channel, ...]
    """Those of its boards."""

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        """Declare what a user may choose about it; ``--seed`` and the lines' faults are common."""

    def from_arguments(self, arguments: argparse.Namespace) -> SimulatedBoard:
        """The board that was chosen; ``arguments.seed`` is the seed of its random numbers."""
