# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Command shaping: checks and limits a command, and turns it into a set-point for the board.

The set-point is in the board's axes and frame.
"""

from collections.abc import Sequence
from enum import Enum
from typing import Literal

from omnibot_driver.core.board import Board, Mode
from omnibot_driver.core.commands.actuator import Actuator
from omnibot_driver.core.commands.limits import SpeedLimits, require_finite
from omnibot_driver.core.commands.orders import TurnWheels
from omnibot_driver.core.commands.set_points import (
    Authority,
    BaseSetpoint,
    GoalSetpoint,
    Setpoint,
    SteadySetpoint,
)
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.geometry.kinematics import Kinematics
from omnibot_driver.core.geometry.se2 import Pose, Signs
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.odometry.estimator import Odometry

ControlMethod = Literal["velocity", "position"]


class CommandShaper:
    """The checks and limits of motion commands. Every method may raise CommandRefused.

    * ``limits``, ``kinematics``: may be replaced at any time.
    * ``control``: position of the control switch on the board; None if there is no switch.
    """

    def __init__(
        self,
        board: Board,
        actuator: Actuator,
        odometry: Odometry,
        limits: SpeedLimits,
        kinematics: Kinematics,
        axis_signs: Signs,
        control: ControlMethod | None,
    ) -> None:
        self.limits, self.kinematics = limits, kinematics
        self._board, self._actuator, self._odometry = board, actuator, odometry
        self._axis_signs, self._control = axis_signs, control
        self.limited = 0
        """Number of commands that exceeded the limits."""
        self.sideways = False
        """Whether the last commanded body velocity had a sideways part that the wheels cannot
        produce."""

    @property
    def takes_velocities(self) -> bool:
        """Whether the board accepts velocities. It does not if position control is selected."""
        return self._control != "position"

    def base(self, twist: BodyTwist, *, before: Setpoint | None, since: float) -> Setpoint:
        """Return the set-point for a body velocity.

        ``before``: the set-point that the new one will replace.
        """
        if not self.takes_velocities:
            raise self._at_odds(Authority.BASE)
        limited = feasible = self.kinematics.feasible(twist)
        self.sideways = feasible.vy_mps != twist.vy_mps
        if not self.limits.allow(twist):
            require_finite("cmd_vel", (twist.vx_mps, twist.vy_mps, twist.yaw_rate_radps))
            limited = self.limits.twist(feasible)
            self.limited += limited != feasible
        x, y, yaw = self._axis_signs
        return BaseSetpoint(
            BodyTwist(x * limited.vx_mps, y * limited.vy_mps, yaw * limited.yaw_rate_radps),
            self.limits,
            self._actuator.is_zero,
            before=before,
            since=since,
        )

    def wheels(self, rates_radps: Sequence[float], *, by: Enum) -> Setpoint:
        """Return the set-point for wheel rates in rad/s. The order is that of ``Traits.wheels``.

        ``by``: the topic that commands.
        """
        if not self.takes_velocities:
            raise self._at_odds(Authority.WHEELS)
        wheels = self._board.traits.wheels
        if len(rates_radps) != len(wheels):
            raise CommandRefused(
                f"wheel_cmd rejected: it has {len(rates_radps)} values; send exactly {len(wheels)},"
                f" the rates of wheels {', '.join(wheels)} in rad/s"
            )
        require_finite("wheel_cmd", rates_radps)
        limited = self.limits.wheels(rates_radps)
        self.limited += limited != tuple(rates_radps)
        return SteadySetpoint(by, TurnWheels(limited), self._actuator.is_zero)

    def pose(self, goal: Pose, *, before: Setpoint | None) -> Setpoint:
        """Return the set-point to drive to a pose in the odometry frame and stay there.

        ``before``: the command in effect.
        """
        if self._control == "velocity":
            raise self._at_odds(Authority.POSE)
        require_finite("cmd_pose", (goal.x_m, goal.y_m, goal.yaw_rad))
        own = self._board.traits.own_odometry
        place = goal if own else self._odometry.in_board_frame(goal)
        if place is None or self._board.mode is Mode.IMU_ONLY:
            raise CommandRefused(
                "cmd_pose refused: the board's own pose is not known; cmd_pose needs nominal mode"
                " and `use_board_pose: true`. After a restart of the board, wait a second"
            )
        return GoalSetpoint(
            goal,
            place,
            self._odometry.alignments,
            self._actuator.is_zero,
            direct=self._control is not None,
            before=before,
        )

    def _at_odds(self, authority: Authority) -> CommandRefused:
        return CommandRefused(
            f"{authority.value} refused: the parameter `control_method` is '{self._control}';"
            " make it match the control switch on the board"
        )
