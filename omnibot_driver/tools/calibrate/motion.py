# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Motions of a calibration: control laws, their bounds, and a check that the robot follows.

This module knows commands and poses; it does not know ROS.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, Literal

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.readings import Vector3
from omnibot_driver.tools.needs import ToolError

Topic = Literal["cmd_vel", "wheel_cmd"]
HALT: Final[Vector3] = (0.0, 0.0, 0.0)

Law = Callable[[float, Pose], Vector3 | None]
"""A function that returns the command, in the units of its topic, or None to end the motion.

Arguments: time in s since the start, and pose relative to the start, with unwrapped yaw.
"""

LOOK_S: Final = 1.0
"""Time, in s, over which the tool compares the commanded with the measured motion."""
SLOW_LOOK_S: Final = 3.0
"""Time, in s, over which the tool compares the commanded with the measured motion, if the board has
one of the parameters in ``SLOW``. For other boards, the time is ``LOOK_S``."""
SLOW: Final = ("odom_rate", "front_wheel_offset")
"""Parameters by which the tool recognises a board whose measured motion may follow a command late.

Such a board measures its motion rarely, or must first turn its front wheel to the new direction.
"""
OBEYED_PART: Final = 0.2
"""Ratio of measured to commanded motion below which the robot is regarded as not moving."""
SCALES: Final = " the switch of the board, `linear_scale` and `angular_scale`,"
PLAIN: Final = {"cmd_vel": (0.03, 0.15), "wheel_cmd": (1.0, 1.0)}
"""Smallest commands for which the tool checks that the robot moves. Friction may prevent slower
motions.

For ``cmd_vel``: linear speed in m/s and yaw rate in rad/s. For ``wheel_cmd``: rad/s.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """Limits of one motion, for the topic ``cmd_vel`` or ``wheel_cmd``.

    * ``speed``, ``turning``: largest commands, in m/s and rad/s.
    * ``way``, ``turn``: largest distance and turn from the start, by the odometry, in m and rad.
    * ``seconds``: longest duration.
    * ``acceleration``, ``angular_acceleration``: in m/s² and rad/s²; infinity: no ramp.

    For ``wheel_cmd``, ``speed`` and ``acceleration`` are those of a wheel, in rad/s and rad/s², and
    ``turning`` has no effect.
    """

    speed: float
    turning: float = math.inf
    way: float
    turn: float = math.inf
    seconds: float
    acceleration: float = 0.3
    angular_acceleration: float = 0.8

    def require_allowed(self, topic: Topic, command: Vector3) -> None:
        """Raise ToolError if a command exceeds the limits or is not finite."""
        if topic == "wheel_cmd":
            allowed = max(map(abs, command)) <= self.speed
        else:
            twist = BodyTwist(*command)
            allowed = not twist.faster_than(self.speed, self.turning)
        if not (all(map(math.isfinite, command)) and allowed):
            raise ToolError(
                f"a command of {_numbers(command)} on {topic} exceeds the limits of this"
                " calibration; choose lower speeds"
            )

    def require_within(self, seconds: float, pose: Pose) -> None:
        """Raise ToolError if the robot is too far from its start, or has driven for too long."""
        if not pose.finite:
            raise ToolError(
                "the robot was stopped because `odom` contains NaN or infinity: find the node"
                " that publishes such values"
            )
        if pose.way_m > self.way:
            where = f"it was {pose.way_m:.2f} m from its start, {self.way:.2f} m allowed"
        elif abs(pose.yaw_rad) > self.turn:
            where = f"it turned by {abs(pose.yaw_rad):.1f} rad, {self.turn:.1f} rad allowed"
        elif seconds > self.seconds:
            where = f"it drove for {seconds:.0f} s, {self.seconds:.0f} s allowed"
        else:
            return
        raise ToolError(
            f"the robot was stopped at a limit of this drive ({where}): check `linear_scale` and"
            " `angular_scale`, and whether `odom` is right (docs/commissioning.md)"
        )

    def approach(self, topic: Topic, now: Vector3, wanted: Vector3, seconds: float) -> Vector3:
        """Return the next command on a ramp from ``now`` to ``wanted``.

        ``seconds``: time since ``now`` was sent.
        """
        if topic == "wheel_cmd":
            a, b, c = _step(now, wanted, self.acceleration * seconds)
            return a, b, c
        vx, vy = _step(now[:2], wanted[:2], self.acceleration * seconds)
        (yaw_rate,) = _step(now[2:], wanted[2:], self.angular_acceleration * seconds)
        return vx, vy, yaw_rate


class Obedience:
    """A check, at short intervals, that the robot roughly follows its commands."""

    def __init__(self, topic: Topic, parameters: Mapping[str, object]) -> None:
        """Prepare the check of the robot's response to commands on this topic.

        ``parameters``: the driver's parameters, by name.
        """
        self._topic = topic
        self._look_s = SLOW_LOOK_S if any(name in parameters for name in SLOW) else LOOK_S
        self._has_scales = "linear_scale" in parameters
        self._began_s = math.nan
        self._told, self._done = [0.0, 0.0], [0.0, 0.0]

    def look(self, now_s: float, seconds: float, command: Vector3, measured: Vector3) -> None:
        """Add the motion in the last ``seconds``, and check at intervals that the robot moves.

        ``measured``: velocity, in the units of ``command``. Raises ToolError if commands above
        ``PLAIN`` yield less than a fifth of the commanded motion.
        """
        if math.isnan(self._began_s):
            self._began_s = now_s
        for number, (told, done) in enumerate(
            zip(self._sizes(command), self._sizes(measured), strict=True)
        ):
            self._told[number] += told * seconds
            self._done[number] += done * seconds
        if now_s - self._began_s < self._look_s:
            return
        told_ways, done_ways = self._told, self._done
        self._began_s, self._told, self._done = now_s, [0.0, 0.0], [0.0, 0.0]
        for told, done, plain in zip(told_ways, done_ways, PLAIN[self._topic], strict=True):
            if told > plain * self._look_s and not done >= OBEYED_PART * told:  # NaN is not motion
                raise ToolError(
                    f"the robot does not move when commanded ({self._topic}): check the motors'"
                    " power,"
                    f"{SCALES if self._has_scales else ''} and what the driver logs"
                )

    def _sizes(self, values: Vector3) -> tuple[float, float]:
        if self._topic == "wheel_cmd":
            return max(map(abs, values)), 0.0
        return math.hypot(values[0], values[1]), abs(values[2])


def stairs(steps: list[tuple[float, Vector3]]) -> Law:
    """Return a control law that gives these commands one after the other, then ends the motion.

    ``steps``: for each command, its duration in s and the command.
    """

    def law(now_s: float, _pose: Pose) -> Vector3 | None:
        for seconds, command in steps:
            if now_s < seconds:
                return command
            now_s -= seconds
        return None

    return law


def _step(now: tuple[float, ...], wanted: tuple[float, ...], longest: float) -> tuple[float, ...]:
    way = math.dist(now, wanted)
    if way <= longest:
        return wanted
    return tuple(a + (b - a) * longest / way for a, b in zip(now, wanted, strict=True))


def _numbers(vector: Vector3) -> str:
    return "(" + ", ".join(f"{value:.3g}" for value in vector) + ")"
