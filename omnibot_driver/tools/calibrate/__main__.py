# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Run a calibration: ``python -m omnibot_driver.tools.calibrate imu|scale|geometry|...``.

Each subcommand is a module of this package that has a function ``run(robot, console, arguments)``.
The function returns a ``Result``.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Final

from omnibot_driver.ros_arguments import split_ros_arguments
from omnibot_driver.tools.calibrate.interruption import Interrupted, Interruption
from omnibot_driver.tools.needs import ToolError, need
from omnibot_driver.tools.printing import replace_unprintable

LIBRARIES: Final = ("numpy", "scipy", "rich", "matplotlib")


def main(argv: Sequence[str] | None = None, read: Callable[[str], str] = input) -> int:
    """Run the subcommand that the command line names.

    ``read``: asks the user a question and returns the answer.

    Returns the exit code: 0 success, 1 failure, 2 wrong usage, 130 interrupted.
    """
    given = list(sys.argv[1:] if argv is None else argv)
    own, ros = split_ros_arguments(given)
    replace_unprintable()
    try:
        with Interruption() as interruption:
            from omnibot_driver.tools.calibrate.arguments import command_line

            arguments = command_line().parse_args(own)
            for library in LIBRARIES:
                need(library)
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


def _calibrate(
    arguments: argparse.Namespace,
    ros_arguments: Sequence[str],
    interruption: Interruption,
    read: Callable[[str], str],
) -> None:
    from omnibot_driver.tools.calibrate.arguments import require_able
    from omnibot_driver.tools.calibrate.console import Console
    from omnibot_driver.tools.calibrate.files import draw, output_file, picture_file, save

    try:
        from omnibot_driver.tools.calibrate.connection import connect
    except ImportError as error:
        raise ToolError(f"this tool needs ROS 2 Jazzy's Python packages: {error}") from error
    run = import_module(f"omnibot_driver.tools.calibrate.{arguments.subcommand}").run
    console = Console(yes=arguments.yes, read=read)
    picture = picture_file(arguments.plot, arguments.subcommand)
    with connect(arguments.namespace, ros_arguments, interruption) as robot:
        require_able(arguments.subcommand, robot.parameters)
        drivers = str(robot.parameters["calibration_file"])
        output = output_file(arguments.output, drivers, robot.table)
        result = run(robot, console, arguments)
        interruption.check()
        try:
            save(result, output, robot.table)
            if result.parameters or result.record:
                interruption.outcome = f"the result is saved to {output}"
        finally:  # report the result even when the file cannot be written
            console.table(f"calibrate {arguments.subcommand}: {robot.driver}", result.findings)
        for note in result.notes:
            console.say(note)
        if result.parameters:
            console.say(f"Written: {output}\nTo load the file, start the driver with")
            console.line(f"  -p calibration_file:={output.absolute()}")
        if arguments.apply:
            robot.apply(result.parameters)
            console.say("Applied to the running driver.")
        draw(result, output, picture)
        console.say(f"Drawn: {picture}")


if __name__ == "__main__":
    sys.exit(main())
