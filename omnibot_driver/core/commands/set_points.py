# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Set-points: motion commands that return the order to send at each time.

The actuator requests the order for each frame, so acceleration limits need no timer.
"""

import math
from collections.abc import Callable
from enum import Enum
from typing import Final, Protocol

from omnibot_driver.core.commands.limits import SpeedLimits
from omnibot_driver.core.commands.orders import Drive, GoTo, Order
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist

LONGEST_STEP_S: Final = 0.05
"""Longest time in s by which one call of ``order`` advances a ramp."""
AT_REST: Final = BodyTwist(0.0, 0.0, 0.0)

LEAVING_M: Final = 0.3
LEAVING_RAD: Final = 2.0
"""``LEAVING_M``, ``LEAVING_RAD``: limits in m and rad. If the distance or the angle to the goal
grows by more than its limit, the robot drives away from the goal. The overshoot of a controller is
smaller.
"""


class Authority(Enum):
    """The common topics that can command the robot. The newest command is in effect.

    A topic that only one board has is a member of that board's own ``Enum``.
    """

    BASE = "cmd_vel"
    WHEELS = "wheel_cmd"
    POSE = "cmd_pose"


class Setpoint(Protocol):
    """A command that is in effect until it expires or is replaced."""

    @property
    def authority(self) -> Enum:
        """Topic that gave the command."""

    @property
    def is_zero(self) -> bool:
        """Whether the command is a standstill. A standstill is sent at once and never ramped."""

    @property
    def settled(self) -> bool:
        """Whether the order no longer changes with time."""

    @property
    def final(self) -> Order:
        """The order at the end of the ramp. Without a ramp, the command has only this order."""

    def order(self, now: float) -> Order:
        """Return the motion order to send to the board at the time ``now``."""

    def check_anew(self) -> None:
        """Check the order with new settings. Raises CommandRefused if it cannot be encoded."""


class BaseSetpoint:
    """A body velocity, approached from the previous one within the acceleration limits.

    * ``is_zero`` (argument): returns whether an order is a standstill; may raise CommandRefused.
    * ``before``: previous set-point. A ramp starts at its velocity, or at rest if it is not a body
      velocity.
    * ``since``: earliest start of a ramp, in s.
    """

    authority: Final = Authority.BASE

    def __init__(
        self,
        wanted: BodyTwist,
        limits: SpeedLimits,
        is_zero: Callable[[Order], bool],
        *,
        before: "Setpoint | None",
        since: float,
    ) -> None:
        self._wanted, self._limits, self._is_zero = wanted, limits, is_zero
        self._order = self.final = Drive(wanted)
        self.is_zero = is_zero(self._order)
        self._setpoint, self._reached_at = wanted, since
        self.settled = self.is_zero or not (limits.linear_mps2 or limits.angular_radps2)
        """Whether the ramp has reached the commanded velocity."""
        if not self.settled:
            self._setpoint = AT_REST
            if isinstance(before, BaseSetpoint):
                self._setpoint = before._setpoint
                settled_at = max(before._reached_at, since)
                self._reached_at = settled_at if before.settled else before._reached_at

    def order(self, now: float) -> Order:
        """Advance the ramp to the time ``now``, and return the order for that time."""
        if not self.settled:
            duration_s = min(now - self._reached_at, LONGEST_STEP_S)
            self._setpoint = self._limits.approach(self._setpoint, self._wanted, duration_s)
            self._order = Drive(self._setpoint)
            self.settled = self._setpoint == self._wanted
        self._reached_at = now
        return self._order

    def check_anew(self) -> None:
        """Update ``is_zero`` for new settings. If the wanted velocity is now zero, end the ramp."""
        self.is_zero = self._is_zero(Drive(self._wanted))
        if self.is_zero:
            self._setpoint, self.settled = self._wanted, True
            self._order = Drive(self._wanted)


class SteadySetpoint:
    """A command whose order does not change.

    * The attribute ``is_zero``: whether the command is a standstill.
    * The constructor's argument ``is_zero``: a function that returns whether an order is a
      standstill. The function may raise CommandRefused.
    """

    settled: Final = True

    def __init__(self, authority: Enum, order: Order, is_zero: Callable[[Order], bool]) -> None:
        self.authority = authority
        self._order, self._is_zero = order, is_zero
        self.final = order
        self.is_zero = is_zero(order)

    def order(self, now: float) -> Order:
        """Return the order to send to the board. Every call returns the same order."""
        return self._order

    def check_anew(self) -> None:
        """Update ``is_zero`` for new settings of the board."""
        self.is_zero = self._is_zero(self._order)


class GoalSetpoint:
    """A pose to drive to.

    * ``goal``: this pose in the odometry frame.
    * ``place``: this pose in the board's earth frame.
    * ``alignment``: ``Odometry.alignments`` at the time of the command; a change discards the goal.
    * ``check``: raises CommandRefused if an order cannot be encoded.
    * ``direct``: whether the board drives straight to the goal.
    """

    authority: Final = Authority.POSE
    is_zero: Final = False
    settled: Final = True

    def __init__(
        self,
        goal: Pose,
        place: Pose,
        alignment: int,
        check: Callable[[Order], object],
        *,
        direct: bool = True,
        before: Setpoint | None = None,
    ) -> None:
        self.alignment = alignment
        self._direct = direct
        self._goal, self._check = goal, check
        self._order = self.final = GoTo(place)
        self._nearest_m = self._nearest_rad = math.inf
        # ``is_left_by`` compares the robot's pose with the smallest distance and angle to the goal
        # so far. A repetition of the goal must not change these two values.
        if isinstance(before, GoalSetpoint):
            apart = before._goal.way_to(goal)
            self._nearest_m = before._nearest_m + apart.way_m
            self._nearest_rad = before._nearest_rad + abs(apart.yaw_rad)
        self.check_anew()

    def order(self, now: float) -> Order:
        """Return the order to send to the board. Every call returns the same order."""
        return self._order

    def check_anew(self) -> None:
        """Raise CommandRefused if the order cannot be encoded with the new settings."""
        self._check(self._order)

    def is_left_by(self, pose: Pose) -> bool:
        """Return whether ``pose`` is clearly farther from the goal than an earlier pose was.

        The result is always False if the board does not drive straight to the goal.
        """
        if not self._direct:
            return False
        way = pose.way_to(self._goal)
        self._nearest_m = min(self._nearest_m, way.way_m)
        self._nearest_rad = min(self._nearest_rad, abs(way.yaw_rad))
        return (
            way.way_m > self._nearest_m + LEAVING_M
            or abs(way.yaw_rad) > self._nearest_rad + LEAVING_RAD
        )
