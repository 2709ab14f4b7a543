# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""``calibrate commission``: guide the user to find how motors and IMU are oriented.

The tool turns the wheels; the user moves the robot by hand, and answers questions. Questions with
contradictory answers are repeated.
"""

import argparse
import math
from collections.abc import Callable
from typing import Any, Final, TypeVar

import numpy as np

from omnibot_driver.core.readings import Vector3
from omnibot_driver.tools.calibrate.commission_result import Found, result_of
from omnibot_driver.tools.calibrate.console import Console
from omnibot_driver.tools.calibrate.log import Log
from omnibot_driver.tools.calibrate.meaning import (
    ControlMethod,
    Drift,
    control_method,
    deltas_are_understood,
    drift,
    frame_is_right,
    require_motion,
)
from omnibot_driver.tools.calibrate.motion import Bounds, stairs
from omnibot_driver.tools.calibrate.mounting import (
    Mounting,
    bias,
    mounting,
    require_left_turn,
    up,
)
from omnibot_driver.tools.calibrate.result import Result
from omnibot_driver.tools.calibrate.seen import (
    AXES,
    WHEELS,
    Contradiction,
    Pattern,
    axis_sign,
    in_words,
    understand,
    wheel_sign,
)
from omnibot_driver.tools.needs import ToolError

TRIES: Final = 3
JOG_S: Final = 2.0
WHEEL_RADPS: Final = 2.0
"""Speed of a wheel while its direction is shown to the user, in rad/s (docs/commissioning.md)."""
AXIS_SPEEDS: Final[tuple[Vector3, ...]] = ((0.05, 0.0, 0.0), (0.0, 0.05, 0.0), (0.0, 0.0, 0.3))
SLOW_LSB: Final = 4
"""Value of Vx in the slow drive, in the board's units (0.06 m/s by default).

The fast drive has exactly twice this value.
"""
TURN_RADPS: Final = 0.5
TURN_RAD: Final = 1.6
HELD_S: Final = 1.5
TURN_BY_HAND_S: Final = 5.0
SETTLING_S: Final = 0.5

T = TypeVar("T")


def run(robot: Any, console: Console, arguments: argparse.Namespace) -> Result:
    """Run the selected parts of the procedure; return the results.

    Raises ToolError if the answers are still contradictory after several tries.
    """
    walk = Walk(robot, console)
    found = Found(before=robot.parameters)
    if "board" in arguments.only or "wheels" in arguments.only:
        console.confirm(
            "The wheels will turn slowly, one by one and together. Is the robot on a box, with all"
            " wheels off the ground, and is somebody at its power switch?"
        )
    if "board" in arguments.only:
        walk.board(found)
    if "wheels" in arguments.only:
        walk.wheels(found)
    if "imu" in arguments.only:
        found.mounting = walk.imu()
    return result_of(found)


class Walk:
    """The guided procedure with the user and the robot."""

    def __init__(self, robot: Any, console: Console) -> None:
        self._robot, self._console = robot, console
        self._obeys = True

    # Found from the board's data

    def board(self, found: Found) -> None:
        """Find the position of the board's mode switch, and the frame of the odometry deltas.

        The results are written to ``found``.
        """
        say = self._console.say
        slow_mps = SLOW_LSB / self._robot.parameters["linear_scale"]
        if 2 * slow_mps > self._robot.parameters["max_linear_speed"]:
            raise ToolError(
                f"the driver's max_linear_speed is below the {2 * slow_mps:.3f} m/s of this check,"
                " so the robot could not follow the commands: raise max_linear_speed to this speed"
                " or more, then begin again"
            )
        say("Checking the mode switch: the wheels drive forward slowly, then twice as fast.")
        slow, fast, found.control_method = self._mode_switch(slow_mps)
        if found.control_method == "position":
            say(
                f"The commands were {slow_mps:.3f} m/s, then {2 * slow_mps:.3f} m/s. At the end"
                f" of these commands the robot moved at {slow.late_mps:.3f} m/s and"
                f" {fast.late_mps:.3f} m/s. Its speed did not follow the commands, so the switch is"
                " on positional control."
            )
            return
        say(
            f"The robot moved at {slow.speed_mps:.3f} m/s, then at {fast.speed_mps:.3f} m/s. Its"
            " speed followed the commands, so the switch is on velocity control."
        )
        say("Checking the odometry deltas: a turn on the spot, then another drive forward.")
        seconds = TURN_RAD / TURN_RADPS
        log = self._drive([(seconds, (0.0, 0.0, TURN_RADPS))], obeys=False)
        began_s = log.commands.stamp_s[0]
        turning = drift(log.odometry, began_s + SETTLING_S, began_s + seconds)
        frame = str(found.before["delta_frame"])
        if not deltas_are_understood(turning, found.before["base_radius"]):
            found.delta_frame = "earth" if frame == "wheel_counts" else "wheel_counts"
            say(
                f"In a turn on the spot, the odometry shows {turning.speed_mps:.3f} m/s sideways."
                f" So delta_frame must be {found.delta_frame}, not {frame}."
            )
            self._obeys = False  # with the wrong delta_frame, the driver reports wrong speeds
            return
        turned_rad = float(log.odometry.pose[-1, 2] - log.odometry.pose[0, 2])
        log = self._drive([(JOG_S, (2 * slow_mps, 0.0, 0.0))], obeys=False)
        began_s = log.commands.stamp_s[0]
        again = drift(log.odometry, began_s + SETTLING_S, began_s + JOG_S)
        right = frame == "wheel_counts" or frame_is_right(fast, again, turned_rad)
        found.delta_frame = frame if right else {"earth": "body", "body": "earth"}[frame]
        wrong = f"not {frame}: with {frame}, the odometry shows this drive in a wrong direction"
        verdict = "as set" if right else wrong
        say(
            f"The robot has turned by {turned_rad:.2f} rad and driven forward. So delta_frame is"
            f" {found.delta_frame}, {verdict}."
        )

    def _mode_switch(self, slow_mps: float) -> tuple[Drift, Drift, ControlMethod]:
        """Drive at ``slow_mps``, then twice as fast; return both motions and the control method.

        The method is velocity control or position control, as selected by the board's switch.
        """
        for _ in range(TRIES):
            log = self._drive(
                [(JOG_S, (slow_mps, 0.0, 0.0)), (JOG_S, (2 * slow_mps, 0.0, 0.0))], obeys=False
            )
            require_motion(log.odometry)
            changes = np.flatnonzero(np.diff(log.commands.values[:, 0], prepend=0.0))
            slow_s, fast_s, end_s = log.commands.stamp_s[changes]
            slow = drift(log.odometry, slow_s + SETTLING_S, fast_s)
            fast = drift(log.odometry, fast_s + SETTLING_S, end_s)
            if method := control_method(slow, fast, slow_mps):
                return slow, fast, method
            self._console.say(
                f"The speed changed from {slow.early_mps:.3f} m/s to {slow.late_mps:.3f} m/s in the"
                f" slow drive, and from {fast.early_mps:.3f} m/s to {fast.late_mps:.3f} m/s in the"
                " fast one. This is neither velocity nor positional control; trying again."
            )
        raise ToolError(
            f"the robot did not keep a steady speed in {TRIES} attempts: reduce the load of this"
            " computer, check that the wheels turn freely, and begin again"
        )

    # Found by looking at the wheels

    def wheels(self, found: Found) -> None:
        """Check the order of the wheels, and find the signs of the axes.

        The results are written to ``found``.
        """
        self._console.say(
            "Look at each wheel from outside, towards the robot's centre. According to the"
            " manual, A is front right, B front left, C at the back.\nAnswer with three signs, for"
            " A, B and C: + for counter-clockwise, - for clockwise, 0 for still. For example, +00"
            " means that only A turned. Answer r to see the motion again."
        )
        signs = [self._until_possible(lambda n=wheel: self._wheel(n)) for wheel in range(3)]  # type: ignore[misc]
        a, b, c = signs
        found.wheel_signs = (a, b, c)
        if len(set(signs)) > 1:
            odd = WHEELS[next(n for n in range(3) if signs.count(signs[n]) == 1)]
            raise ToolError(
                f"wheel {odd} turns in the opposite direction to the other two: no parameter"
                f" corrects a single wheel; check how motor and encoder of wheel {odd} are"
                " connected, then begin again"
            )
        if found.control_method == "position":
            self._console.say("With the switch on positional control, the axes cannot be checked.")
            return
        seen = [self._until_possible(lambda n=axis: self._axis(n)) for axis in range(3)]  # type: ignore[misc]
        x, y, yaw = (now * sign for now, sign in zip(found.before["axis_signs"], seen, strict=True))
        found.axis_signs = (x, y, yaw)

    def _wheel(self, wheel: int) -> int:
        a, b, c = (WHEEL_RADPS if n == wheel else 0.0 for n in range(3))
        seen = self._show(f"wheel_cmd for wheel {WHEELS[wheel]} alone", (a, b, c), "wheel_cmd")
        sign = wheel_sign(wheel, seen)
        self._console.say(
            f"Wheel {WHEELS[wheel]} is where it should be"
            + (" and turns as the manual says." if sign > 0 else ", but turns in reverse.")
        )
        return sign

    def _axis(self, axis: int) -> int:
        seen = self._show(f"cmd_vel, +{AXES[axis]}", AXIS_SPEEDS[axis], "cmd_vel")
        sign = axis_sign(axis, seen)
        self._console.say(
            f"+{AXES[axis]} is "
            + ("correct." if sign > 0 else "reversed: its sign in axis_signs changes.")
        )
        return sign

    def _show(self, what: str, command: Vector3, topic: str) -> Pattern:
        """Run a motion, and return in which direction the user saw each wheel turn.

        For each of the wheels A, B and C: 1 counter-clockwise, -1 clockwise, 0 still.
        """
        while True:
            self._console.say(f"\n{what}:")
            self._drive([(JOG_S, command)], topic=topic, obeys=self._obeys)
            seen = self._console.ask(
                "What did A, B, C do?",
                _understand,
                "Please answer with three signs (each +, - or 0), such as +00. Answer r to see the"
                " motion again.",
            )
            if seen:
                self._console.say(f"Your answer means: {in_words(seen)}.")
                a, b, c = seen
                return a, b, c

    # Found from gravity

    def imu(self) -> Mounting:
        """Find the mounting of the IMU."""
        console = self._console
        console.say(
            "\nNow the IMU. The motors stay off. Hold the robot as asked, and keep it still."
        )
        return self._until_possible(self._postures)

    def _postures(self) -> Mounting:
        ask = self._console.wait
        ask("Put the robot down on a level floor, and do not touch it.")
        resting = self._robot.rest(HELD_S).imu
        level = up(resting)
        ask("Raise the robot's front by about 30°, and hold it still.")
        nose_up = up(self._robot.rest(HELD_S).imu)
        ask("Put the robot down. Then raise its left side by about 30°, and hold it still.")
        left_up = up(self._robot.rest(HELD_S).imu)
        found = mounting(level, nose_up, left_up)
        ask(
            "Put the robot down. Then press Enter, and turn the robot to the left by hand within"
            f" {TURN_BY_HAND_S:.0f} s, by a quarter turn or more."
        )
        turn_rad = require_left_turn(self._robot.rest(TURN_BY_HAND_S).imu, bias(resting), level)
        self._console.say(
            f"The gyro measured a turn to the left by {turn_rad:.1f} rad, as expected: gyro and"
            " accelerometer agree about which way is up."
        )
        return found

    # Common to all parts

    def _until_possible(self, find: Callable[[], T]) -> T:
        """Call ``find`` until it succeeds; return its result.

        ``find`` raises Contradiction for an impossible answer or measurement. After several such
        failures, this method raises ToolError.
        """
        for _ in range(TRIES):
            try:
                return find()
            except Contradiction as error:
                said = str(error)
                self._console.say(f"This result cannot be right: {said}. Please try again.")
        raise ToolError(f"{said}; no clear result after several tries, see docs/commissioning.md")

    def _drive(
        self, plan: list[tuple[float, Vector3]], *, topic: str = "cmd_vel", obeys: bool
    ) -> Log:
        fastest = max(max(map(abs, command)) for _, command in plan)
        bounds = Bounds(
            speed=fastest + 1e-6,
            way=math.inf,
            seconds=sum(seconds for seconds, _ in plan) + 2.0,
            acceleration=math.inf,
            angular_acceleration=math.inf,
        )
        log: Log = self._robot.drive(
            stairs(plan), bounds, topic=topic, obeys=obeys, monitored=False
        )
        return log


def _understand(answer: str) -> tuple[int, ...] | None:
    """Convert the user's answer, such as ``+0-``, to a direction (1, -1 or 0) for each wheel.

    The result is empty for ``r`` (show the motion again), and None if the answer is not valid.
    """
    return () if answer == "r" else understand(answer)
