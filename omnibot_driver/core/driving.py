# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Motion commands, from a wish to what comes of it: when each expires, and whether the robot obeys.

Composes the helm, the command stream and the watch. Knows no modes and no requests: whether a robot
may be driven now is decided elsewhere.
"""

import math
from collections.abc import Sequence
from typing import Final

from omnibot_driver.core.board import Board, DisplacementReading
from omnibot_driver.core.commands import PACE_S, CommandSettings, CommandStream
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.helm import ControlMethod, Helm
from omnibot_driver.core.kinematics import BodyTwist
from omnibot_driver.core.limits import SpeedLimits, require_timely
from omnibot_driver.core.measuring import Estimate
from omnibot_driver.core.motion import GoalMotion, Motion
from omnibot_driver.core.odometry import Odometry, OdometryEstimate
from omnibot_driver.core.se2 import Pose, Signs
from omnibot_driver.core.snapshot import CommandFigures
from omnibot_driver.core.watch import Finding, Watch

Wish = tuple[Motion, float]
"""A motion that may be commanded, and when it expires."""
NEVER: Final = math.inf


class Driving:
    """``stream`` is what goes out; ``obeys``: whether the robot can be expected to do it."""

    def __init__(
        self,
        board: Board,
        odometry: Odometry,
        limits: SpeedLimits,
        commands: CommandSettings,
        axis_signs: Signs,
        control: ControlMethod,
        *,
        obeys: bool,
    ) -> None:
        self._stop = board.stop()
        self.stream = CommandStream(
            commands, stop=self._stop, emergency_stop=board.emergency_stop()
        )
        self._odometry = odometry
        self._helm = Helm(board, odometry, limits, axis_signs, control)
        self._watch = Watch()
        self._obeys = obeys

    def configure(self, limits: SpeedLimits, commands: CommandSettings, now: float) -> list[str]:
        """New settings, from the next command and frame on; sentences for the user.

        What was commanded under looser ones ends.
        """
        stricter = commands.timeout_s < self.stream.settings.timeout_s or limits.stricter_than(
            self._helm.limits
        )
        self._helm.limits, self.stream.settings = limits, commands
        current = self.stream.current
        if not stricter or current is None or current.stands or isinstance(current, GoalMotion):
            return []
        self.stream.halt(now)
        return ["the robot is stopped, as its limits are stricter now: command it anew"]

    def encode_anew(self, now: float) -> list[str]:
        """The board's settings have changed: the command that is repeated is said in them."""
        if self.stream.current is None:
            return []
        try:
            self.stream.current.encode_anew(self._stop)
        except CommandRefused as error:
            self.stream.halt(now)
            return [f"robot stopped, the current command does not fit the new scale: {error}"]
        return []

    def figures(self, now: float) -> CommandFigures:
        """Who commands, and how."""
        current = self.stream.current
        return CommandFigures(
            source=current.authority.value if current else None,
            age_s=now - self.stream.commanded_at,
            limited=self._helm.limited,
            estop=self.stream.latched,
        )

    def begin(self) -> None:
        """What was commanded and seen has nothing to do with what comes."""
        self.stream.discard()
        self._watch.begin()

    def release(self, now: float) -> None:
        """End the e-stop."""
        self.stream.release(now)
        self._watch.release()

    def twist(self, twist: BodyTwist, now: float, *, age_s: float) -> Wish:
        """Drive the body. Raises CommandRefused, as all wishes do."""
        timeout_s = self.stream.settings.timeout_s
        expires_at = now + timeout_s
        if age_s:
            require_timely("cmd_vel", age_s, timeout_s)
            expires_at -= max(0.0, age_s)
        motion = self._helm.base(twist, before=self.stream.current, since=now - PACE_S)
        return motion, expires_at

    def wheels(self, rates_radps: Sequence[float], now: float) -> Wish:
        """Turn wheels A, B, C."""
        return self._helm.wheels(rates_radps), now + self.stream.settings.timeout_s

    def pose(self, goal: Pose) -> Wish:
        """Drive to a pose in the odometry frame."""
        return self._helm.pose(goal), NEVER

    def look(
        self, reading: DisplacementReading, estimates: Sequence[Estimate], now: float
    ) -> list[str]:
        """Hold what the robot did against what it was told; sentences for the user."""
        self.stream.proof.look(reading, now)
        news = []
        finding = self._watch.look(reading, self.stream.current) if self._obeys else None
        if finding is not None:
            if finding is Finding.ASTRAY:
                self.stream.halt(now)
            if self._watch.is_news(finding):
                news.append(finding.value)
        return news + self.check_goal(estimates, now)

    def check_goal(self, estimates: Sequence[Estimate], now: float) -> list[str]:
        """Drop a goal that is another place by now, or that the robot drives away from."""
        goal = self.stream.current
        if not isinstance(goal, GoalMotion):
            return []
        if goal.alignment != self._odometry.alignments:
            why = "odom begins anew"
        elif any(
            goal.is_left_by(estimate.pose)
            for estimate in estimates
            if isinstance(estimate, OdometryEstimate)
        ):
            why = "the robot drives away from it: does the board's switch stand on position?"
        else:
            return []
        self.stream.halt(now)
        return [f"the goal of cmd_pose is discarded: {why}"]
