# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The command line of the calibrations.

This module must not import libraries that only a calibration needs, so that ``--help`` works
without them.
"""

import argparse
import math
from collections.abc import Mapping
from typing import Final

from omnibot_driver.core.imu.scale import STANDARD_GRAVITY
from omnibot_driver.tools.calibrate.seen import WHEELS
from omnibot_driver.tools.needs import ToolError

PARTS: Final = ("board", "wheels", "imu")


GAINS: Final = "left_kp"
"""Name of a parameter. If a board has this parameter, the board records encoder ticks, and the
gains of the board's speed controller can be set."""
NEEDS: Final = {
    "commission": (("delta_frame",), "the OmniBot's wheels and odometry"),
    "imu": (("gyro_bias",), "an IMU"),
    "scale": (
        ("linear_scale", "odom_linear_scale"),
        "the parameter `linear_scale` or `odom_linear_scale`",
    ),
    "geometry": (
        ("base_radius", "odom_linear_scale"),
        "the parameter `base_radius` or `odom_linear_scale`",
    ),
    "step": (("delta_frame", GAINS), "a wheel controller whose model is known"),
}
"""For each subcommand: names of parameters, of which the driver must have at least one, and a text
that describes this requirement in the error message."""


def require_able(subcommand: str, parameters: Mapping[str, object]) -> None:
    """Raise ToolError if the driver has none of the parameters that the subcommand needs."""
    wanted, thing = NEEDS[subcommand]
    if not any(parameter in parameters for parameter in wanted):
        raise ToolError(
            f"calibrate {subcommand} needs {thing}, which the board {parameters['board']} does not"
            " have"
        )


def command_line() -> argparse.ArgumentParser:
    """Return the parser of the command line; it exits with 2 and a message on wrong usage."""
    parser = argparse.ArgumentParser(
        prog="calibrate",
        description="Measures values for the driver's parameters, with uncertainties.",
    )
    parser.epilog = (
        "`calibrate WHAT --help` lists the options. Give ROS arguments after --ros-args. Exit"
        " codes: 0 with a result, 1 with a message on failure, 2 on wrong usage, 130 when"
        " interrupted. See docs/tools/calibrate.md."
    )
    subparsers = parser.add_subparsers(dest="subcommand", required=True, metavar="WHAT")
    for name, (summary, add_arguments) in SUBCOMMANDS.items():
        subparser = subparsers.add_parser(name, help=summary, description=summary)
        add_arguments(subparser)
        subparser.add_argument(
            "--yes",
            action="store_true",
            help="answer yes to every yes-or-no question",
        )
        subparser.add_argument(
            "--output",
            metavar="FILE",
            help="YAML file for the results. The default is the driver's calibration_file. If the"
            " driver has none, it is omnibot_calibration.yaml in the current folder",
        )
        subparser.add_argument(
            "--plot",
            metavar="FILE",
            help="file or folder for the picture (default:"
            f" calibrate_{name}.png in the current folder)",
        )
        subparser.add_argument(
            "--apply",
            action="store_true",
            help="also set the results in the running driver, except for parameters that the"
            " driver reads only at its start",
        )
        subparser.add_argument(
            "--namespace",
            default="",
            metavar="NAME",
            help="namespace of the driver, such as /robot1",
        )
    return parser


def _commission(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--only",
        nargs="+",
        choices=PARTS,
        default=PARTS,
        metavar="PART",
        help=f"parts to run, any of {', '.join(PARTS)} (default: all)",
    )


def _imu(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--minutes",
        type=_positive,
        default=1.0,
        help="time at rest in minutes (default 1). With ten or more, the result also shows"
        " how the bias drifts",
    )
    parser.add_argument(
        "--gravity",
        type=_positive,
        default=STANDARD_GRAVITY,
        metavar="M/S²",
        help="gravity at your place, in m/s² (default %(default)s)",
    )


def _scale(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--speed", type=_positive, default=0.25, help="highest speed, m/s (default %(default)s)"
    )
    parser.add_argument(
        "--turning",
        type=_positive,
        default=0.5,
        help="highest yaw rate, rad/s (default %(default)s)",
    )
    parser.add_argument(
        "--levels",
        type=_whole,
        default=3,
        help="number of speeds along each axis (default %(default)s)",
    )
    parser.add_argument(
        "--seconds", type=_positive, default=2.0, help="seconds at each speed (default %(default)s)"
    )
    _by_tape(parser.add_argument_group("for boards without angular_scale"))


def _by_tape(parser: argparse._ActionsContainer) -> None:
    parser.add_argument(
        "--side",
        type=_positive,
        default=1.0,
        help="length of lines and of the sides of squares, m (default %(default)s)",
    )
    parser.add_argument(
        "--turns",
        type=_whole,
        default=3,
        help="number of turns on the spot in each direction (default %(default)s)",
    )
    parser.add_argument(
        "--tape",
        type=_positive,
        default=2.0,
        help="standard deviation of your tape readings, mm (default %(default)s)",
    )
    parser.add_argument(
        "--angle",
        type=_positive,
        default=1.0,
        help="standard deviation of your heading readings, degrees (default %(default)s)",
    )


def _geometry(parser: argparse.ArgumentParser) -> None:
    _by_tape(parser)
    parser.add_argument(
        "--speed", type=_positive, default=0.2, help="highest speed, m/s (default %(default)s)"
    )
    parser.add_argument(
        "--turning",
        type=_positive,
        default=0.5,
        help="highest yaw rate, rad/s (default %(default)s)",
    )
    parser.add_argument(
        "--without-squares",
        action="store_true",
        help="drive only lines and turns: faster, but less accurate",
    )


def _step(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--wheels", default=WHEELS, help=f"wheels to measure, such as AB (default {WHEELS})"
    )
    parser.add_argument(
        "--speeds",
        type=float,
        nargs=2,
        default=(4.0, 12.0),
        metavar=("SLOW", "FAST"),
        help="the two speeds between which a wheel alternates, in rad/s (default 4 12)",
    )
    parser.add_argument(
        "--hold", type=_positive, default=1.5, help="seconds at each speed (default 1.5)"
    )
    parser.add_argument(
        "--steps",
        type=_whole,
        default=8,
        help="number of steps in each direction of rotation (default 8). A step is a change of the"
        " speed, alternately from slow to fast and from fast to slow",
    )
    parser.add_argument(
        "--gains",
        type=_positive,
        nargs=3,
        metavar=("K_FF", "K_VP", "K_VI"),
        help="gains that the firmware uses now (default: the manual's 40 10 1.5)",
    )
    tuning = parser.add_argument_group("for boards whose gains are parameters")
    for name, default, words in (
        ("records", 24, "number of starts at full duty to record"),
        ("responses", 3, "number of steps of the set-point to record for each set of gains"),
        ("samples", 120, "number of encoder ticks of each wheel in a record"),
    ):
        tuning.add_argument(
            f"--{name}", type=_whole, default=default, help=f"{words} (default %(default)s)"
        )
    for name, value, words in (
        ("overshoot", 5.0, "largest allowed overshoot of a step, %%"),
        ("band", 5.0, "largest deviation from the final speed once a step has settled, %%"),
        ("destination", 50.0, "set-point of the step, %% of the speed at full duty"),
        ("settling", 2.0, "time in which a step should settle, s"),
        ("phase-margin", 60.0, "smallest allowed phase margin, degrees"),
        ("control-frequency", 11.0, "rate of the controller in the firmware, Hz"),
    ):
        tuning.add_argument(
            f"--{name}", type=_positive, default=value, help=f"{words} (default %(default)s)"
        )
    tuning.add_argument(
        "--gain-optimum",
        action="store_true",
        help="find the fastest gains without a limit on the phase margin; Td is 0",
    )


def _positive(text: str) -> float:
    """Parse a number above 0, or raise argparse's error."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number above 0")
    return value


def _whole(text: str) -> int:
    """Parse a whole number of at least 1, or raise argparse's error."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number of at least 1")
    return int(text)


SUBCOMMANDS: Final = {
    "commission": (
        "directions of the wheels, axes and IMU, in a guided check; wheels off the ground",
        _commission,
    ),
    "imu": (
        "bias and noise of the IMU, its tilt, and Allan deviation; the robot stands still",
        _imu,
    ),
    "scale": (
        "linear_scale and angular_scale, from commanded and measured speeds; the robot drives",
        _scale,
    ),
    "geometry": (
        "wheel and base radius, by your tape measure; the robot drives lines and squares",
        _geometry,
    ),
    "step": (
        "step response and motor of each wheel, and better gains; wheels off the ground",
        _step,
    ),
}
