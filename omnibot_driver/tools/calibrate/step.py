# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""``calibrate step``: measure each wheel's step response, fit its motor, find better gains.

One wheel at a time alternates between two speeds, in each direction.
"""

import argparse
import math
from collections.abc import Callable, Sequence
from typing import Any, Final

from omnibot_driver.core.readings import Vector3
from omnibot_driver.tools.calibrate import pi_step
from omnibot_driver.tools.calibrate.arguments import GAINS
from omnibot_driver.tools.calibrate.console import Console
from omnibot_driver.tools.calibrate.motion import Bounds, Law, stairs
from omnibot_driver.tools.calibrate.result import Result
from omnibot_driver.tools.calibrate.seen import WHEELS
from omnibot_driver.tools.calibrate.step_fit import Step, fit_wheel, steps_of
from omnibot_driver.tools.calibrate.step_result import result_of
from omnibot_driver.tools.calibrate.wheel_loop import MANUAL, TICK_S, Gains
from omnibot_driver.tools.needs import ToolError

RUN_UP_S: Final = 2.0
"""Time, in s, for the start from rest to the first speed. The start is not evaluated, because
friction affects it."""


def run(robot: Any, console: Console, arguments: argparse.Namespace) -> Result:
    """Record steps of each wheel, fit the models to them, and find better gains."""
    if GAINS in robot.parameters:
        return pi_step.run(robot, console, arguments)
    wheels = [WHEELS.index(name) for name in _wheels(arguments.wheels)]
    levels = _levels(robot.parameters, arguments)
    _law, seconds = _to_and_fro(levels, arguments)
    console.confirm(
        f"The wheels will turn one after another, each for {2 * seconds:.0f} s and at up to"
        f" {levels[1]:.1f} rad/s. Is the robot on a box, with all wheels off the ground and nothing"
        " near them?"
    )
    now = Gains(*arguments.gains) if arguments.gains else MANUAL
    found = []
    for wheel in wheels:
        steps: list[Step] = []
        with console.progress(f"wheel {WHEELS[wheel]}") as show:
            for part, sign in enumerate((1.0, -1.0)):
                steps += _record(
                    robot,
                    wheel,
                    [sign * level for level in levels],
                    arguments,
                    lambda s, part=part: show((part + s / seconds) / 2),  # type: ignore[misc]
                )
        found.append(fit_wheel(WHEELS[wheel], steps, now))
    return result_of(found, now)


def _record(
    robot: Any,
    wheel: int,
    levels: Sequence[float],
    arguments: argparse.Namespace,
    show: Callable[[float], object],
) -> list[Step]:
    law, seconds = _to_and_fro(levels, arguments, wheel)
    bounds = Bounds(
        speed=max(map(abs, levels)) + 1e-6,
        way=math.inf,
        seconds=seconds + 1.0,
        acceleration=math.inf,
    )
    log = robot.drive(law, bounds, topic="wheel_cmd", monitored=False, show=show)
    return steps_of(log.commands, log.wheels, wheel, levels)


def _to_and_fro(
    levels: Sequence[float], arguments: argparse.Namespace, wheel: int = 0
) -> tuple[Law, float]:
    """Return a control law that alternates a wheel between two speeds, and the law's duration in s.

    The steps begin at different times between two odometry deltas, so that all steps together show
    the whole response.
    """
    plan: list[tuple[float, Vector3]] = []
    for number in range(arguments.steps + 1):
        seconds = arguments.hold if number else RUN_UP_S
        seconds += 4 * TICK_S * (0.618 * number % 1.0)
        a, b, c = (levels[number % 2] if n == wheel else 0.0 for n in range(3))
        plan.append((seconds, (a, b, c)))
    return stairs(plan), sum(seconds for seconds, _ in plan)


def _wheels(names: str) -> str:
    wanted = names.upper().replace(",", "")
    if not wanted or set(wanted) - set(WHEELS):
        raise ToolError(f"--wheels must be one or more of the letters {WHEELS}, not {names!r}")
    return "".join(sorted(set(wanted)))


def _levels(parameters: dict[str, Any], arguments: argparse.Namespace) -> tuple[float, float]:
    """Return the slow and the fast speed in rad/s, rounded to whole units of the board's command.

    Raises ToolError if an option is not allowed, or if the speeds are equal.
    """
    slow, fast = arguments.speeds
    if not 0.0 < slow < fast <= parameters["max_wheel_speed"]:
        raise ToolError(
            "--speeds must be two speeds, the slower one first, above 0 and up to the driver's"
            f" max_wheel_speed of {parameters['max_wheel_speed']:g} rad/s"
        )
    if arguments.hold < 0.5 or arguments.steps < 2:
        raise ToolError("--hold must be at least 0.5 s, and --steps at least 2")
    lsb = parameters["linear_scale"] * parameters["wheel_radius"]
    words = round(slow * lsb), round(fast * lsb)
    if words[0] < 1 or words[1] <= words[0]:
        raise ToolError(
            f"--speeds {slow:g} {fast:g} become commands of {words[0]} and {words[1]} units of"
            f" {1 / lsb:.2f} rad/s: choose speeds of at least one unit, and further apart"
        )
    return words[0] / lsb, words[1] / lsb
