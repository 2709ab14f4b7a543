# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What a user may choose about a simulated board: one table for the command line and for sim://.

Knows words and their meaning. Must not know what runs the board.
"""

import argparse
from typing import NoReturn, get_args
from urllib.parse import parse_qsl, urlsplit

from omnibot_driver.simulator.common.faults import FaultyLine, LineFaults
from omnibot_driver.simulator.omnibot.firmware import SimulatedBoard
from omnibot_driver.simulator.omnibot.motors import TICK_S
from omnibot_driver.simulator.omnibot.receivers import FramingName, LetterPlace, ReceiverKind
from omnibot_driver.simulator.omnibot.settings import BoardSettings


class OptionError(ValueError):
    """An option that is unknown or has a value that it cannot have; the text says which."""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise OptionError(message)


def add_board_options(parser: argparse.ArgumentParser) -> None:
    """Let the parser know them all."""
    parser.add_argument("--seed", type=int, default=0, help="of all random numbers (default 0)")
    parser.add_argument("--imu-only", action="store_true", help="run in IMU only mode")
    parser.add_argument(
        "--frame",
        choices=("earth", "body", "wheel_counts"),
        default="earth",
        help="meaning of the 25 Hz frame (default earth)",
    )
    parser.add_argument(
        "--delta-period",
        type=_ticks,
        default=0.04,
        metavar="SECONDS",
        help="from one such frame to the next (default 0.04; the manual also has 0.1)",
    )
    parser.add_argument(
        "--control",
        choices=("velocity", "position"),
        default="velocity",
        help="where the on-board switch stands (default velocity)",
    )
    parser.add_argument(
        "--receiver",
        choices=get_args(FramingName),
        default="counting",
        help="how the firmware finds control frames: it counts bytes after FF FE, for ever "
        "(counting, the default); the same, and FF FF FE is no header (naive); the same, and a "
        "pause of 5 ms ends half a frame (idle_gap); it searches the last 9 bytes (window)",
    )
    parser.add_argument(
        "--letters",
        choices=get_args(LetterPlace),
        default="between",
        help="where S, P and R act: between control frames, or anywhere (default between)",
    )
    parser.add_argument(
        "--wakes-while-booting",
        action="store_true",
        help="bytes that arrive while the board boots count for its three wake-up bytes",
    )
    parser.add_argument(
        "--ignore-estop", action="store_true", help="the firmware knows no emergency stop"
    )
    parser.add_argument(
        "--latching-estop",
        action="store_true",
        help="an emergency stop holds until the board is reset",
    )
    parser.add_argument(
        "--running", action="store_true", help="start in the running mode instead of booting"
    )
    for fault, effect in (
        ("lose", "is lost"),
        ("burst", "begins a burst of up to 200 lost bytes"),
        ("flip", "arrives with one bit changed"),
    ):
        parser.add_argument(
            f"--{fault}",
            type=_chance,
            default=0.0,
            metavar="RATE",
            help=f"chance that a byte the board sends {effect} (default 0)",
        )


def board_from(arguments: argparse.Namespace) -> tuple[SimulatedBoard, FaultyLine]:
    """The board that was chosen, and the line that its bytes go through."""
    board = SimulatedBoard(
        BoardSettings(
            seed=arguments.seed,
            frame=arguments.frame,
            delta_period_s=arguments.delta_period,
            imu_only=arguments.imu_only,
            control=arguments.control,
            receiver=ReceiverKind(
                framing=arguments.receiver,
                letters=arguments.letters,
                wakes_while_booting=arguments.wakes_while_booting,
            ),
            obeys_estop=not arguments.ignore_estop,
            estop_latches=arguments.latching_estop,
            running=arguments.running,
        )
    )
    faults = LineFaults(lose=arguments.lose, burst=arguments.burst, flip=arguments.flip)
    return board, FaultyLine(faults, arguments.seed)


def board_from_url(url: str) -> tuple[SimulatedBoard, FaultyLine]:
    """The board of ``sim://?seed=1&imu_only``. Raises OptionError."""
    parts = urlsplit(url)
    if place := parts.netloc + parts.path:
        raise OptionError(f"'{place}' must come after a question mark")
    words = [
        f"--{name.replace('_', '-')}" + (f"={value}" if value else "")
        for name, value in parse_qsl(parts.query, keep_blank_values=True)
    ]
    parser = _Parser(add_help=False, allow_abbrev=False)
    add_board_options(parser)
    arguments, unknown = parser.parse_known_args(words)
    if unknown:
        raise OptionError(f"there is no option '{unknown[0].lstrip('-')}'")
    return board_from(arguments)


def _ticks(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = 0.0
    ticks = seconds / TICK_S
    if not 0.999 < ticks < 1000.5 or abs(ticks - round(ticks)) > 1e-6:
        raise argparse.ArgumentTypeError(
            f"{text!r} is no period of the board: give a multiple of {TICK_S:g} up to 10"
        )
    return seconds


def _chance(text: str) -> float:
    try:
        chance = float(text)
    except ValueError:
        chance = -1.0
    if not 0.0 <= chance <= 1.0:
        raise argparse.ArgumentTypeError(f"{text!r} is no probability: give a number from 0 to 1")
    return chance
