# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Judge ``calibrate step`` on random robots with a LOIS ECU and unknown motors.

Run this by hand, with the number of robots and optionally the first seed (2 min for each robot):

    PYTHONPATH=.:test:test/core:test/tools/lois_ecu python test/tools/lois_ecu/judge_step.py 20

The program prints the overshoot of the true wheel speeds in a step with the gains that ``calibrate
step`` found. For this step, the robot's encoders have evenly spaced marks.
"""

import contextlib
import io
import math
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from unittest.mock import patch

import numpy as np
from lois_robot import SimulatedRobot, random_motors

from omnibot_driver.simulator.lois_ecu import MotorSettings
from omnibot_driver.tools.calibrate import pi_step
from omnibot_driver.tools.calibrate.arguments import command_line
from omnibot_driver.tools.calibrate.console import Console
from omnibot_driver.tools.calibrate.pi_result import WheelTuned

STEP_S = 4.0
RPM = math.tau / 60
"""One revolution a minute, in rad/s."""
Motors = tuple[MotorSettings, MotorSettings]


def calibrated(motors: Motors, folder: Path, seed: int) -> list[WheelTuned]:
    """Run ``calibrate step`` on a simulated robot, and return what it finds for both wheels."""
    robot = SimulatedRobot(folder, motors, seed=seed)
    arguments = command_line().parse_args(["step", "--yes"])
    with (
        patch.object(pi_step, "result_of") as result_of,
        contextlib.redirect_stdout(io.StringIO()),
    ):
        pi_step.run(robot, Console(yes=True), arguments)
    wheels: list[WheelTuned] = result_of.call_args.args[0]
    return wheels


def true_overshoots(motors: Motors, wheels: Sequence[WheelTuned], folder: Path) -> list[float]:
    """Return the overshoot of each wheel's true speed in a step with the found gains.

    The overshoot is relative to the final speed or the target, whichever is higher.
    """
    robot = SimulatedRobot(folder, motors, mark_noise=0.0)
    found = pi_step._gains({wheel.name: wheel.tuned for wheel in wheels})
    robot.set_parameters(found | pi_step._corrections({one.name: one.levels for one in wheels}))
    robot.rest(4.0)
    speeds = []
    for step in range(round(STEP_S / 0.01)):
        if step % 5 == 0:
            rates = [wheel.tuned.target_rpm * RPM for wheel in wheels]
            robot.bench.session.command_wheels(rates, robot.bench.now)
            robot.bench.settle()
        robot.bench.run(0.01)
        speeds.append([motor.rpm for motor in robot.board.motors])
    rpm = np.array(speeds)
    targets = np.array([wheel.tuned.target_rpm for wheel in wheels])
    comes_to = np.maximum(rpm[-len(rpm) // 4 :].mean(axis=0), targets)
    return list(rpm.max(axis=0) / comes_to - 1.0)


def main(robots: int, first: int = 0) -> None:
    """Print a row for each wheel of ``robots`` random robots, whose seeds begin at ``first``."""
    for seed in range(first, first + robots):
        motors = random_motors(seed)
        with tempfile.TemporaryDirectory() as name:
            wheels = calibrated(motors, Path(name), seed)
            overshoots = true_overshoots(motors, wheels, Path(name))
        for wheel, motor, overshoot in zip(wheels, motors, overshoots, strict=True):
            slow = wheel.fit.slow_s / motor.time_constant_s - 1.0
            fast = wheel.fit.fast_s / motor.second_time_constant_s - 1.0
            print(
                f"{seed:2} {wheel.name:5} slow {motor.time_constant_s:.3f} s {slow:+.1%}, fast"
                f" {motor.second_time_constant_s:.3f} s {fast:+.1%}, overshoot {overshoot:.1%},"
                f" error {wheel.after.error_s:.2f} s (before {wheel.before.error_s:.2f} s)",
                flush=True,
            )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
