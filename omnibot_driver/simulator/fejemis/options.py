# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Command line options of a simulated Fejemis, except its seed and the faults of its lines.

This module must not know the program that runs the boards.
"""

import argparse
from math import inf
from typing import get_args

from omnibot_driver.simulator.common.options import chance
from omnibot_driver.simulator.fejemis.board import SimulatedFejemis
from omnibot_driver.simulator.fejemis.faults import FAULTS, SENSOR_FAULTS, allowed
from omnibot_driver.simulator.fejemis.settings import Fault, FejemisSettings, Firmware, Reverse

_DEFAULT = FejemisSettings()
_SWITCHES = (
    ("timed-velocity", "vel lines begin with the time"),
    ("acceleration-in-g", "acc lines are in g instead of m/s²"),
    ("tilt", "pose lines have a fifth number, the tilt"),
    (
        "start-resumes",
        "after a start command, the board obeys the last rc command again, even one that it"
        " received while it was stopped",
    ),
    ("confirms", "the board confirms a command that begins with !"),
    ("single-precision", "times are float32, so after an hour they advance in steps of 0.2 ms"),
)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add all options to the parser."""
    parser.add_argument(
        "--sums",
        choices=("on", "off"),
        default="on",
        help="on (the default): each line has a checksum, ;NN, as in the public host programs."
        " off: lines have no checksum, as in the manual",
    )
    parser.add_argument(
        "--reverse",
        choices=get_args(Reverse),
        default="mirrored",
        help="the front wheel's angle for driving a curve backward. mirrored (the default): as for"
        " driving the curve forward. clamped: at most 90 degrees",
    )
    for name, effect in _SWITCHES:
        parser.add_argument(f"--{name}", action="store_true", help=effect)
    parser.add_argument(
        "--no-start-line",
        action="store_true",
        help="the boards do not send the line '# Starting main loop' at the end of a boot",
    )
    parser.add_argument(
        "--boot",
        type=_seconds,
        default=_DEFAULT.boot_s,
        metavar="SECONDS",
        help="duration of a boot (default 0.4)",
    )
    parser.add_argument(
        "--swapped",
        action="store_true",
        help="the front Teensy is at the first port, and the drive Teensy at the second",
    )
    parser.add_argument(
        "--ids",
        type=_ids,
        default=_DEFAULT.ids,
        metavar="DRIVE,FRONT",
        help="ids of the two boards in their heartbeats (default 90,91)",
    )
    parser.add_argument(
        "--uptime",
        type=float,
        default=0.0,
        metavar="SECONDS",
        help="how long the boards have been running when the simulation starts. With 0, the"
        " default, they boot first",
    )
    parser.add_argument(
        "--volts", type=float, default=_DEFAULT.volts, help="battery voltage (default 24.9)"
    )
    parser.add_argument(
        "--front-m",
        type=float,
        default=_DEFAULT.front_m,
        metavar="M",
        help="distance from the start to a wall in front (default none)",
    )
    parser.add_argument(
        "--lose-inbound",
        type=chance,
        default=0.0,
        metavar="RATE",
        help="chance that a byte to a board is lost (default 0)",
    )
    parser.add_argument(
        "--fault",
        type=_fault,
        action="append",
        default=[],
        metavar="SECONDS:HALF:WHAT",
        help="let the fault WHAT occur in one of the two Teensys (HALF: drive or front), SECONDS"
        " after the start."
        " Repeat the option for more faults. The faults 'well' and 'sensor-well' end earlier"
        f" faults. Faults of either half: {', '.join(FAULTS)}; of the front half only:"
        f" {', '.join(SENSOR_FAULTS)}",
    )


def from_arguments(arguments: argparse.Namespace) -> SimulatedFejemis:
    """Return the simulated Fejemis that the parsed options describe."""
    names = [name.replace("-", "_") for name, _ in _SWITCHES]
    return SimulatedFejemis(
        FejemisSettings(
            firmware=Firmware(
                sums=arguments.sums == "on",
                reverse=arguments.reverse,
                says_start=not arguments.no_start_line,
                **{name: getattr(arguments, name) for name in names},
            ),
            seed=arguments.seed,
            swapped=arguments.swapped,
            ids=arguments.ids,
            boot_s=arguments.boot,
            uptime_s=arguments.uptime,
            volts=arguments.volts,
            front_m=arguments.front_m,
            lose_inbound=arguments.lose_inbound,
            faults=tuple(arguments.fault),
        )
    )


def _fault(text: str) -> Fault:
    at, half, what = (*text.split(":"), "", "")[:3]
    try:
        at_s = float(at)
    except ValueError:
        at_s = -1.0
    if not at_s >= 0.0 or half not in ("drive", "front") or what not in allowed(half):
        raise argparse.ArgumentTypeError(f"{text!r} is not a fault such as 5:front:silent")
    return Fault(at_s=at_s, half=half, what=what)


def _ids(text: str) -> tuple[int, int]:
    drive, _, front = text.partition(",")
    if not (drive.isdecimal() and front.isdecimal()):
        raise argparse.ArgumentTypeError(f"{text!r} is not a pair of ids such as 90,91")
    return int(drive), int(front)


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = -1.0
    if not 0.0 <= seconds < inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a duration in seconds")
    return seconds
