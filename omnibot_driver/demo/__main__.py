# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Command line of the demo: ``python -m omnibot_driver.demo``."""

import argparse
import io
import json
import math
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import Final

from omnibot_driver import boards
from omnibot_driver.core.errors import ParameterError
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.demo import capability as capabilities
from omnibot_driver.demo.dashboard import Dashboard
from omnibot_driver.demo.display import HEADING, Drive, introduce, report
from omnibot_driver.demo.program import PATIENCE_S, DemoFailed, Program
from omnibot_driver.simulator.common.options import DEFAULT_BOARD

ENVIRONMENT: Final = {"ROS_DOMAIN_ID": "97", "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
"""Environment variables that the demo sets if the user has not set them.

They keep the demo out of ROS domain 0, which a real robot may use.
"""
STOPPING_S: Final = 3.0
ROW_EVERY_S: Final = 1.0


def run(board: str, seconds: float, asked_to_end: Callable[[], bool]) -> None:
    """Run the demo: drive for ``seconds``, or until ``asked_to_end`` or the user ends the demo.

    Raises ParameterError for an unknown board, ImportError without ROS, and DemoFailed if the demo
    cannot continue.
    """
    capability = capabilities.of(board)
    namespace = f"/demo_{os.getpid()}"
    show_at_s = 0.0
    with ExitStack() as stack:
        chosen = () if board == DEFAULT_BOARD else ("--board", board)
        simulator = Program("simulator", *chosen, console=True)
        stack.callback(simulator.end)
        addresses = {port: simulator.ask() for port in capability.ports}
        ports = capabilities.port_arguments(board, {p: at for p, at in addresses.items() if p})
        driver = Program("driver", "--ros-args", *ports.split(), "-r", f"__ns:={namespace}")
        stack.callback(driver.end)
        from omnibot_driver.demo.robot import Robot

        robot = Robot(namespace, imu=capability.imu, sideways=capability.sideways)
        stack.callback(robot.close)
        exports = " ".join(f"{name}={os.environ[name]}" for name in ENVIRONMENT)
        programs = ("".join(f" {word}" for word in chosen), ports)
        introduce(capability, programs, namespace, exports, seconds)
        dashboard = Dashboard(namespace)
        stack.callback(dashboard.close)
        if not dashboard.possible:
            print(HEADING)

        def done_with() -> bool:
            return asked_to_end() or dashboard.quitted

        def go_on_until(done: Callable[[], bool], longest_s: float) -> bool:
            nonlocal show_at_s
            deadline_s = time.monotonic() + longest_s
            while not done() and (now_s := time.monotonic()) < deadline_s:
                simulator.check()
                driver.check()
                robot.spin_once()
                if now_s >= show_at_s and not dashboard.possible:
                    show_at_s = now_s + ROW_EVERY_S
                    print(robot.row(), flush=True)
            return done()

        if not go_on_until(lambda: done_with() or not robot.missing(), PATIENCE_S):
            missing = ", ".join(robot.missing())
            raise driver.failure(f"after {PATIENCE_S:g} s still missing: {missing}")
        if dashboard.possible:
            go_on_until(lambda: done_with() or robot.watched(), PATIENCE_S)
        if done_with():
            dashboard.close()
            print("The demo was ended before the robot drove.")
            return
        started_s = time.monotonic()
        rates = [rate for rate in (robot.odom, robot.imu) if rate is not None]
        counts = [rate.count for rate in rates]
        robot.driving = True
        go_on_until(done_with, seconds)
        driven_s = time.monotonic() - started_s
        odom_hz, *imu_hz = (
            (rate.count - before) / driven_s for rate, before in zip(rates, counts, strict=True)
        )
        robot.driving = False
        go_on_until(robot.stands, STOPPING_S)
        dashboard.close()
        if not dashboard.possible:
            print(robot.row())
        truth = json.loads(simulator.ask("truth\n"))
        report(
            Drive(
                seconds=driven_s,
                way_m=robot.driven_m,
                laps=robot.leg / 4,
                imu_hz=imu_hz[0] if imu_hz else None,
                odom_hz=odom_hz,
                pose=robot.pose,
                true_pose=Pose(truth["x_m"], truth["y_m"], truth["yaw_rad"]),
                points=robot.points,
                real=capability.real,
                page=capability.page,
            )
        )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the demo; return the exit code.

    The demo ends after ``DEMO_SECONDS``, at SIGINT or SIGTERM, or when the user quits the monitor.
    """
    parser = argparse.ArgumentParser(
        prog="demo",
        description="Lets a simulated robot drive a square. A real robot is not needed.",
        epilog="The environment variable DEMO_SECONDS sets the duration in seconds; without it the"
        " demo runs until ctrl-C. Exit codes: 0 at the end, 1 with a message on failure, 2 on wrong"
        " usage.",
    )
    parser.add_argument(
        "--board",
        default=DEFAULT_BOARD,
        metavar="NAME",
        help=f"the board: {', '.join(boards.PROFILES)} (default {DEFAULT_BOARD})",
    )
    board = parser.parse_args(arguments).board
    given = os.environ.get("DEMO_SECONDS") or "inf"
    try:
        seconds = float(given)
    except ValueError:
        seconds = math.nan
    if not seconds > 0.0:
        print(f"DEMO_SECONDS must be a number above 0, not {given!r}", file=sys.stderr)
        return 2
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # prints ? for characters that the encoding lacks
    signals: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda received, _frame: signals.append(received))
    for name, default in ENVIRONMENT.items():
        os.environ[name] = os.environ.get(name) or default
    try:
        run(board, seconds, lambda: bool(signals))
    except ImportError as error:
        print(f"The demo needs ROS 2 Jazzy's Python packages: {error}", file=sys.stderr)
        return 1
    except ParameterError as error:
        print(f"demo: {error}", file=sys.stderr)
        return 2
    except DemoFailed as error:
        print(f"\ndemo: {error}", file=sys.stderr)
        return 1
    except BrokenPipeError:  # the pipe's reader has ended
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
