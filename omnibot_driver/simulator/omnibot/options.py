# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Options of a simulated OmniBot, except its seed and the faults of its line.

This module knows options. It must not know what runs the board.
"""

import argparse
from typing import get_args

from omnibot_driver.simulator.omnibot.firmware import SimulatedBoard
from omnibot_driver.simulator.omnibot.motors import TICK_S
from omnibot_driver.simulator.omnibot.receivers import FramingName, LetterPlace, ReceiverKind
from omnibot_driver.simulator.omnibot.settings import BoardSettings


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add all options to the parser."""
    parser.add_argument(
        "--imu-only", action="store_true", help="send IMU frames and no odometry (IMU-only mode)"
    )
    parser.add_argument(
        "--frame",
        choices=("earth", "body", "wheel_counts"),
        default="earth",
        help="content of the delta frame, which is sent at 25 Hz. earth (the default):"
        " displacement in the board's earth frame. body: displacement in the robot's frame."
        " wheel_counts: encoder counts",
    )
    parser.add_argument(
        "--delta-period",
        type=_ticks,
        default=0.04,
        metavar="SECONDS",
        help="period of the delta frame in s (default 0.04; the manual also states 0.1)",
    )
    parser.add_argument(
        "--control",
        choices=("velocity", "position"),
        default="velocity",
        help="position of the on-board switch (default velocity)",
    )
    parser.add_argument(
        "--receiver",
        choices=get_args(FramingName),
        default="counting",
        help="how the firmware finds control frames. counting (the default): it counts seven bytes"
        " after FF FE, without a timeout. naive: like counting, but it misses the header in FF FF"
        " FE. idle_gap: like counting, but 5 ms without a byte end an incomplete frame. window: it"
        " accepts the last 9 bytes whenever they begin with FF FE",
    )
    parser.add_argument(
        "--letters",
        choices=get_args(LetterPlace),
        default="between",
        help="where the letters S, P and R take effect. between (the default): only between"
        " control frames. anywhere: also within a control frame",
    )
    parser.add_argument(
        "--wakes-while-booting",
        action="store_true",
        help="let bytes that arrive during the boot count among the three bytes that wake the"
        " receiver; without this option, only later bytes count",
    )
    parser.add_argument(
        "--ignore-estop", action="store_true", help="simulate a firmware without emergency stop"
    )
    parser.add_argument(
        "--latching-estop",
        action="store_true",
        help="after an emergency stop, refuse all motion until the board is reset",
    )
    parser.add_argument(
        "--running", action="store_true", help="start in the running mode instead of booting"
    )


def from_arguments(arguments: argparse.Namespace) -> SimulatedBoard:
    """Return the board that the parsed options describe."""
    return SimulatedBoard(
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


def _ticks(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = 0.0
    ticks = seconds / TICK_S
    if not 0.999 < ticks < 1000.5 or abs(ticks - round(ticks)) > 1e-6:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a period of the board; give a multiple of {TICK_S:g} s up to 10 s"
        )
    return seconds
