# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Interfaces between a simulated board and the code that runs, connects or selects it.

This module contains only values and protocols. It must not know any particular board.
"""

import argparse
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

Packet = tuple[int, bytes]
"""Index of the channel, and the bytes: one complete datagram if the channel carries datagrams."""


@dataclass(frozen=True, slots=True)
class Channel:
    """One connection between a board and the computer.

    * ``name``: empty if the board has only one channel.
    * ``parameter``: the driver's parameter for this port; empty if this is the UDP port after that
      of the previous channel.
    * ``datagrams``: whether the channel carries UDP datagrams instead of serial bytes.
    """

    name: str = ""
    parameter: str = "port"
    datagrams: bool = False


class SimulatedBoard(Protocol):
    """A board with its robot. The same settings and input always give the same output."""

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Connections of the board. The channel number of a packet is an index of this tuple."""

    @property
    def tick_s(self) -> float:
        """Board time that passes with each ``advance``, in s."""

    def receive(self, data: bytes, now: float, channel: int, /) -> None:
        """Receive data that was sent to the board; a later ``advance`` returns the reply.

        * ``data``: one datagram, or any chunk of serial bytes.
        * ``now``: arrival time in s, by any monotonic clock.
        """

    def advance(self) -> list[Packet]:
        """Advance by one tick; return the packets that the board sends in this tick, in order."""

    def reboot(self) -> None:
        """Power-cycle the board; the robot keeps its true pose."""

    @property
    def facts(self) -> Mapping[str, object]:
        """State of the robot and the board, as values that JSON can represent.

        ``x_m``, ``y_m``, ``yaw_rad``: true pose relative to the initial pose. The yaw is unwrapped.
        """


class SimulatorModule(Protocol):
    """The names that the package of a simulated board must define."""

    TITLE: str
    """Name of the board in the sentence "A simulated ... board listens on"."""
    CHANNELS: tuple[Channel, ...]
    """Connections of the board to the computer."""

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        """Add the options of this board to the parser, except those that all boards share."""

    def from_arguments(self, arguments: argparse.Namespace) -> SimulatedBoard:
        """Return the board that the options describe.

        ``arguments.seed``: seed of the random numbers.
        """
