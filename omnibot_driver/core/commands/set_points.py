# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What is commanded, as the order that it is at each moment.

A ``Setpoint`` is one command. The actuator asks it for its order whenever a frame goes out, so a
set-point that nears its target by an acceleration limit needs no timer of its own. Whether it may
be commanded, and when a frame goes out, is others' business.
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
"""A frame that goes out late does not make up for more time than this."""
AT_REST: Final = BodyTwist(0.0, 0.0, 0.0)

LEAVING_M: Final = 0.3
LEAVING_RAD: Final = 2.0
"""No controller that drives to a goal overshoots by this much."""


class Authority(Enum):
    """The topic that commands the robot; the value is its name. One at a time, the newest."""

    BASE = "cmd_vel"
    WHEELS = "wheel_cmd"
    POSE = "cmd_pose"


class Setpoint(Protocol):
    """A command that is current until it expires or is replaced."""

    @property
    def authority(self) -> Authority:
        """The topic that gave the command."""

    @property
    def is_zero(self) -> bool:
        """Whether it commands standstill, which never waits and is never ramped."""

    @property
    def settled(self) -> bool:
        """Whether the next order is the same as this one."""

    def order(self, now: float) -> Order:
        """The order at this time."""

    def check_anew(self) -> None:
        """Check the order with new settings. Raises CommandRefused if they cannot encode it."""


class BaseSetpoint:
    """A body velocity, approached by the acceleration limits from what was commanded before.

    ``is_zero`` is the actuator's. Raises CommandRefused.
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
        self._order = Drive(wanted)
        self.is_zero = is_zero(self._order)
        self._setpoint, self._reached_at = wanted, since
        self.settled = self.is_zero or not (limits.linear_mps2 or limits.angular_radps2)
        """Whether the set-point has arrived."""
        if not self.settled:
            self._setpoint = AT_REST
            if isinstance(before, BaseSetpoint):
                self._setpoint = before._setpoint
                self._reached_at = max(before._reached_at, since)

    def order(self, now: float) -> Order:
        """The set-point of this time; asking moves it."""
        if not self.settled:
            duration_s = min(now - self._reached_at, LONGEST_STEP_S)
            self._setpoint = self._limits.approach(self._setpoint, self._wanted, duration_s)
            self._order = Drive(self._setpoint)
            self.settled = self._setpoint == self._wanted
        self._reached_at = now
        return self._order

    def check_anew(self) -> None:
        """Continue a ramp with new settings."""
        self.is_zero = self._is_zero(Drive(self._wanted))
        if self.is_zero:
            self._setpoint, self.settled = self._wanted, True
            self._order = Drive(self._wanted)


class SteadySetpoint:
    """A command whose order does not change. Raises CommandRefused."""

    settled: Final = True

    def __init__(
        self, authority: Authority, order: Order, is_zero: Callable[[Order], bool]
    ) -> None:
        self.authority = authority
        self._order, self._is_zero = order, is_zero
        self.is_zero = is_zero(order)

    def order(self, now: float) -> Order:
        """The order, which does not change."""
        return self._order

    def check_anew(self) -> None:
        """Update whether the order is a standstill with the present settings."""
        self.is_zero = self._is_zero(self._order)


class GoalSetpoint:
    """A pose to drive to: ``goal`` in the odometry frame, as that lay at this ``alignment``.

    ``place`` is the same in the board's frame; ``direct``: the board drives straight at it, and
    nowhere else first. Raises CommandRefused.
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
    ) -> None:
        self.alignment = alignment
        self._direct = direct
        self._goal, self._order, self._check = goal, GoTo(place), check
        self._nearest_m = self._nearest_rad = math.inf
        self.check_anew()

    def order(self, now: float) -> Order:
        """The order, which does not change."""
        return self._order

    def check_anew(self) -> None:
        """Check that the order can still be encoded."""
        self._check(self._order)

    def is_left_by(self, pose: Pose) -> bool:
        """Whether the robot has been clearly nearer to the goal before."""
        if not self._direct:
            return False
        way = pose.way_to(self._goal)
        self._nearest_m = min(self._nearest_m, way.way_m)
        self._nearest_rad = min(self._nearest_rad, abs(way.yaw_rad))
        return (
            way.way_m > self._nearest_m + LEAVING_M
            or abs(way.yaw_rad) > self._nearest_rad + LEAVING_RAD
        )
