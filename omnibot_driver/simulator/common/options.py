# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Options common to all simulated boards, on the command line and in a sim:// URL.

This module must not know any board, or the program that runs it.
"""

import argparse
from collections.abc import Sequence
from importlib import import_module
from typing import NoReturn, cast
from urllib.parse import parse_qsl, urlsplit

from omnibot_driver.simulator.common.board import Channel, SimulatedBoard, SimulatorModule
from omnibot_driver.simulator.common.faults import FaultyLine, LineFaults
from omnibot_driver.simulator.common.network import FaultyNetwork, NetworkFaults
from omnibot_driver.simulator.common.wired import Line

DEFAULT_BOARD = "omnibot"
"""Default board of the driver and of the simulator."""


class OptionError(ValueError):
    """An unknown option or an invalid value; the text names it."""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise OptionError(message)


def load(module: str) -> SimulatorModule:
    """Import and return the package of a simulated board.

    ``module``: the full name of the package.
    """
    return cast(SimulatorModule, import_module(module))


def command(module: str) -> str:
    """Return the shell command that simulates the board of the package ``module``.

    The command with ``--help`` lists the options of the board.
    """
    board = module.rpartition(".")[2]
    return "simulator" if board == DEFAULT_BOARD else f"simulator --board {board}"


def add_options(parser: argparse.ArgumentParser, simulator: SimulatorModule) -> None:
    """Add all options of this board and of its lines to the parser."""
    parser.add_argument(
        "--seed", type=int, default=0, help="seed of all random numbers (default 0)"
    )
    simulator.add_options(parser)
    serial = any(not channel.datagrams for channel in simulator.CHANNELS)
    datagrams = any(channel.datagrams for channel in simulator.CHANNELS)
    lost = ["a byte from the board"] * serial + ["a datagram, in either direction,"] * datagrams
    _add_rate(parser, "lose", f"chance that {' or '.join(lost)} is lost")
    if serial:
        burst = "begins a burst of up to 200 lost bytes"
        _add_rate(parser, "burst", f"chance that a byte from the board {burst}")
        _add_rate(parser, "flip", "chance that a byte from the board arrives with one bit changed")
    if datagrams:
        _add_rate(parser, "duplicate", "chance that a datagram, in either direction, arrives twice")
        parser.add_argument(
            "--delay",
            type=_delay,
            default=0.0,
            metavar="SECONDS",
            help="largest random delay of a datagram in s, in either direction (default 0). A"
            " datagram can arrive before one that was sent earlier",
        )


def from_arguments(
    arguments: argparse.Namespace, simulator: SimulatorModule
) -> tuple[SimulatedBoard, list[Line]]:
    """Return the simulated board and its lines, as the parsed arguments describe them."""
    return simulator.from_arguments(arguments), [
        _line(arguments, channel, number) for number, channel in enumerate(simulator.CHANNELS)
    ]


def from_url(url: str, simulator: SimulatorModule) -> tuple[SimulatedBoard, list[Line]]:
    """Return the simulated board and its lines for a URL such as ``sim://?seed=1&imu_only``.

    Raises OptionError for an unknown option or an invalid value.
    """
    parts = urlsplit(url)
    if place := parts.netloc + parts.path:
        raise OptionError(f"'{place}' must come after a question mark, as in sim://?seed=1")
    words = [
        f"--{name.replace('_', '-')}" + (f"={value}" if value else "")
        for name, value in parse_qsl(parts.query, keep_blank_values=True)
    ]
    return from_words(words, simulator)


def from_words(
    words: Sequence[str], simulator: SimulatorModule
) -> tuple[SimulatedBoard, list[Line]]:
    """Return the simulated board and its lines, as command line arguments describe them.

    Raises OptionError for an unknown option or an invalid value.
    """
    parser = _Parser(add_help=False, allow_abbrev=False)
    add_options(parser, simulator)
    arguments, unknown = parser.parse_known_args(words)
    if unknown:
        raise OptionError(f"there is no option '{unknown[0].lstrip('-')}'")
    return from_arguments(arguments, simulator)


def _line(arguments: argparse.Namespace, channel: Channel, number: int) -> Line:
    seed = f"{arguments.seed} {number}" if number else str(arguments.seed)
    if channel.datagrams:
        return FaultyNetwork(
            NetworkFaults(
                lose=arguments.lose, duplicate=arguments.duplicate, delay_s=arguments.delay
            ),
            seed,
        )
    faults = LineFaults(lose=arguments.lose, burst=arguments.burst, flip=arguments.flip)
    return FaultyLine(faults, seed)


def _add_rate(parser: argparse.ArgumentParser, name: str, effect: str) -> None:
    parser.add_argument(
        f"--{name}", type=chance, default=0.0, metavar="RATE", help=f"{effect} (default 0)"
    )


def chance(text: str) -> float:
    """Return the probability that the argument ``text`` states.

    Raises ArgumentTypeError if the text is not a number from 0 to 1.
    """
    value = _number(text)
    if not 0.0 <= value <= 1.0:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a probability; give a number from 0 to 1"
        )
    return value


def _delay(text: str) -> float:
    delay_s = _number(text)
    if not 0.0 <= delay_s <= 60.0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a delay; give seconds from 0 to 60")
    return delay_s


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return -1.0
