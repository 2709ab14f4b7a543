# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Runs a calibration: ``python -m omnibot_driver.tools.calibrate imu|scale|geometry|...``.

Each subcommand is a module of this package with ``add_arguments(parser)`` and
``run(robot, console, arguments) -> Result``.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any, Final

from omnibot_driver.tools.calibrate.interruption import Interrupted, Interruption
from omnibot_driver.tools.needs import ToolError, need
from omnibot_driver.tools.ros_arguments import split_ros_arguments

SUBCOMMANDS: Final = {
    "commission": "which way round everything is: a guided walk, wheels off the ground",
    "imu": "gyro bias and noise, accelerometer level, Allan deviation: the robot rests",
    "scale": "linear_scale and angular_scale from commanded and measured speeds: the robot drives",
    "geometry": "wheel and base radius by your tape measure: the robot drives lines and squares",
    "step": "how each wheel follows a step, its motor, better gains: wheels off the ground",
}


def main(argv: Sequence[str] | None = None, read: Callable[[str], str] = input) -> int:
    """Return 0 when a calibration was found, 1 with a sentence when not, 2 for wrong usage, 130
    when interrupted.

    ``read`` answers questions.
    """
    given = list(sys.argv[1:] if argv is None else argv)
    own, ros = split_ros_arguments(given)
    try:
        with Interruption() as interruption:
            for library in ("numpy", "scipy", "rich", "matplotlib"):
                need(library)
            arguments = _parser().parse_args(own)
            _calibrate(arguments, ros, interruption, interruption.reading(read))
    except Interrupted as error:
        print(f"\ncalibrate: {error}", file=sys.stderr)
        return 130
    except ToolError as error:
        print(f"calibrate: {error}", file=sys.stderr)
        return 1
    except SystemExit as usage:
        return int(usage.code or 0)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="calibrate",
        description="Finds what the driver's parameters ought to be, with uncertainties.",
    )
    parser.epilog = (
        "WHAT --help lists the options. ROS's own arguments follow --ros-args. Ends with 0, with 1"
        " and a sentence when nothing was found, with 2 on wrong usage, with 130 when interrupted."
        " See docs/calibrate.md."
    )
    subparsers = parser.add_subparsers(dest="subcommand", required=True, metavar="WHAT")
    for name, summary in SUBCOMMANDS.items():
        subparser = subparsers.add_parser(name, help=summary, description=summary)
        _module(name).add_arguments(subparser)
        subparser.add_argument("--yes", action="store_true", help="yes to every question")
        subparser.add_argument(
            "--output",
            metavar="FILE",
            help="YAML file to write into (default: the driver's calibration_file, else"
            " omnibot_calibration.yaml here)",
        )
        subparser.add_argument(
            "--plot",
            metavar="FILE",
            help=f"picture, or a folder for it (default: calibrate_{name}.png here)",
        )
        subparser.add_argument(
            "--apply",
            action="store_true",
            help="also set what was found in the running driver, as far as it may change there",
        )
        subparser.add_argument(
            "--namespace", default="", metavar="NAME", help="the driver's, such as /robot1"
        )
    return parser


def _calibrate(
    arguments: argparse.Namespace,
    ros_arguments: Sequence[str],
    interruption: Interruption,
    read: Callable[[str], str],
) -> None:
    from omnibot_driver.tools.calibrate.console import Console
    from omnibot_driver.tools.calibrate.files import output_file, picture_file, write

    try:
        from omnibot_driver.tools.calibrate.robot import connect
    except ImportError as error:
        raise ToolError(f"this tool needs ROS 2 Jazzy's Python packages: {error}") from error
    console = Console(yes=arguments.yes, read=read)
    picture = picture_file(arguments.plot, arguments.subcommand)
    with connect(arguments.namespace, ros_arguments, interruption) as robot:
        output = output_file(arguments.output, str(robot.parameters["calibration_file"]))
        result = _module(arguments.subcommand).run(robot, console, arguments)
        interruption.check()
        console.table(f"calibrate {arguments.subcommand}: {robot.driver}", result.findings)
        for note in result.notes:
            console.say(note)
        write(result, output, picture)
        console.say(f"Drawn: {picture}")
        if result.parameters:
            console.say(
                f"Written: {output}\nThe driver loads it at its start with -p calibration_file:="
                f"{output.absolute()}"
            )
        if arguments.apply:
            robot.apply(result.parameters)
            console.say("Applied to the running driver.")


def _module(subcommand: str) -> Any:
    return import_module(f"omnibot_driver.tools.calibrate.{subcommand}")


if __name__ == "__main__":
    sys.exit(main())
