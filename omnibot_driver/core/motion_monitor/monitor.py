# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The motion monitor: compares the robot's displacements with its set-points.

Velocities are in the board's own axes. Times are on the same clock as the stamps. This module does
not know bytes, and does not know how a robot is stopped. docs/internals/motion_monitor.md explains
the thresholds.
"""

import math
from collections.abc import Mapping
from enum import Enum
from typing import Final

from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.motion_monitor.envelope import dot, speed_of
from omnibot_driver.core.motion_monitor.following_error import FollowingError
from omnibot_driver.core.motion_monitor.set_point_history import (
    AT_REST,
    CommandedTwist,
    SetpointHistory,
    Velocity,
)

LAG_S: Final = 0.4
"""Time in s in which a robot may still move after it was commanded to stand still. This motion
is not regarded as motion without a command."""

PLAIN_MPS: Final = 0.05
PLAIN_RADPS: Final = 0.15
"""``PLAIN_MPS``, ``PLAIN_RADPS``: commanded speeds, in m/s and rad/s, above which the robot must
move. If it does not move for 1 s (``BLOCKED_S``), it is regarded as blocked."""
MOVING_MPS: Final = 0.02
MOVING_RADPS: Final = 0.05
BLOCKED_S: Final = 1.0

STOOD_S: Final = 0.5
"""Time in s. A robot that stands still for this time after Stop has obeyed Stop.

If the robot moves later, the cause is not a lost Stop but, for example, a push.
"""
STOPS_S: Final = 5.0
"""Time in s for which the command policy sends Stop again and again to a robot that keeps moving.
It is equal to the default of this policy."""

REFUSED_IN_A_ROW: Final = 4
COSINE_60: Final = 0.5


class Fault(Enum):
    """The faults of a robot's motion. Each value is the beginning of a sentence for the user."""

    WRONG_WAY = "robot moves in the wrong direction"
    WRONG_TURN = "robot turns in the wrong direction"
    TOO_FAST = "robot moves faster than commanded"
    TURNS_TOO_FAST = "robot turns faster than commanded"
    BEYOND_LIMITS = (
        "robot exceeds `fastest_linear_speed` or `fastest_angular_speed`, its physical limits"
    )
    UNCOMMANDED = "robot is moving without a command"
    BLOCKED = "robot does not move although it is commanded to move"
    HELD_BY_ESTOP = "the e-stop is released and the robot is commanded to move, but it stands still"


STOPPED: Final = frozenset(
    {
        Fault.WRONG_WAY,
        Fault.WRONG_TURN,
        Fault.TOO_FAST,
        Fault.TURNS_TOO_FAST,
        Fault.BEYOND_LIMITS,
    }
)
"""Faults for which a robot that is commanded to move must be stopped."""
ADVICE: Final[Mapping[Fault, str]] = {
    Fault.WRONG_WAY: "check the wiring of the wheels",
    Fault.WRONG_TURN: "check the wiring of the wheels",
    Fault.TOO_FAST: "check the parameters of the wheels and scales",
    Fault.TURNS_TOO_FAST: "check the parameters of the wheels and scales",
    Fault.BEYOND_LIMITS: "check the parameters of the wheels and scales",
    Fault.UNCOMMANDED: (
        "the driver sends Stop. If the robot is not being pushed, switch the motors off by hand"
        " and check the cable"
    ),
    Fault.BLOCKED: "check motor power, and whether the wheels are blocked",
    Fault.HELD_BY_ESTOP: "check whether the board itself still holds an e-stop",
}
"""What the user should check after each fault. A board may replace this advice by its own
``Traits.advice``."""


class MotionMonitor:
    """Compares the motion of one robot with its commands.

    * ``commanded``, ``measured``: the commanded and the measured twist when the last fault "too
      fast" or "wrong way" was found.
    """

    def __init__(self, slack_mps: float = 0.0, slack_radps: float = 0.0) -> None:
        self.commanded = self.measured = AT_REST
        self._history = SetpointHistory()
        self._error = FollowingError(slack_mps, slack_radps)
        self._released = False
        self._told: set[Fault] = set()
        self._refused = self._refused_before = 0
        self.begin()

    def begin(self) -> None:
        """Forget earlier commands and measurements."""
        self._history.clear()
        self._error.reset()
        self._impossible = 0
        self._has_stood = False
        self._stood_s = self._moved_s = self._blocked_s = self._stop_again_s = 0.0

    def set_point(self, setpoint: CommandedTwist, now: float) -> None:
        """Record that ``setpoint`` is commanded from ``now`` on.

        None means that the robot goes to a goal, on a path that the board chooses.
        """
        if setpoint is self._history.current:
            return
        if setpoint == AT_REST:
            setpoint = AT_REST  # the object by which the history recognises rest
        self._history.add(setpoint, now)
        if setpoint is not AT_REST:
            self._has_stood = False

    def release(self) -> None:
        """Record that the driver's e-stop was released.

        The board's own e-stop may still hold the robot. So a blocked robot has the fault
        HELD_BY_ESTOP until it has moved as commanded.
        """
        self._released = True

    def is_news(self, fault: Fault) -> bool:
        """Return whether ``fault`` is new since the robot last moved as commanded.

        This call records the fault, so the next call with the same fault returns False.
        """
        told, self._told = self._told, self._told | {fault}
        return fault not in told

    def count_refused(self, count: int, now: float) -> Fault | None:
        """Return the fault that four rejected displacements in a row show, or None.

        ``count``: number of displacements that the outlier filter has rejected since the driver
        began.
        """
        self._refused = count
        if count < self._refused_before + REFUSED_IN_A_ROW:
            return None
        self._refused_before = count
        return self._exceed(now)

    def count_impossible(self, now: float) -> Fault | None:
        """Return the fault that four impossible displacements in a row show, or None.

        Call this method instead of ``check`` for an impossible displacement of a board that
        corrects its own odometry; fewer than four may be corrections.
        """
        self._error.reset()
        self._impossible += 1
        if self._impossible < REFUSED_IN_A_ROW:
            return None
        self._impossible = 0
        return self._exceed(now)

    def disregard_refused(self, count: int) -> None:
        """Record the number of displacements that were rejected until now. Do not look for a fault.

        This method is called while the robot is not monitored.
        """
        self._refused = self._refused_before = count
        self._impossible = 0

    def check(
        self, motion: BodyTwist, seconds: float, stamp_s: float, *, heading_known: bool
    ) -> Fault | None:
        """Return the fault that a displacement shows, or None.

        ``motion``: mean twist of the displacement, which took ``seconds`` and ended at ``stamp_s``.

        ``heading_known``: if False, the direction of the linear velocity is not checked.
        """
        self._refused_before = self._refused
        self._impossible = 0
        begun_s, current = stamp_s - seconds, self._history.current
        if current is None or not self._history.known(begun_s):
            self._error.reset()
            return None
        error = self._error
        error.update(motion, seconds, self._history, begun_s, heading_known=heading_known)
        if current is AT_REST and not self._history.driven(begun_s - LAG_S):
            return self._unbidden(seconds, begins=error.exceeded)
        self._stood_s = self._moved_s = self._stop_again_s = 0.0
        if error.exceeded:
            self.commanded, self.measured = current, motion
            explained = self._history.explained(begun_s)
            return self._blame(self._name(explained, heading_known=heading_known), stamp_s)
        if error.outside:
            return None
        return self._blocked(motion, seconds, heading_known=heading_known)

    def _exceed(self, now: float) -> Fault | None:
        """Return the fault of a robot that is faster than its physical limits.

        The result is None if the robot may still be slowing down after an earlier fault.
        """
        history = self._history
        if history.current is None or history.driven(now - LAG_S):
            return self._blame(Fault.BEYOND_LIMITS, now)
        return Fault.UNCOMMANDED if history.known(now) else None

    def _blame(self, fault: Fault, now: float) -> Fault:
        """Return ``fault``, and suspend the checks, because the robot may still be slowing down.

        The checks begin again 0.8 s (``UNKNOWN_S``) after the next set-point.
        """
        self._error.reset()
        self._history.add(None, now)
        return fault

    def _name(self, explained: list[Velocity], *, heading_known: bool) -> Fault:
        """Return the fault of motion that does not fit the commands: wrong direction or too fast.

        The direction of linear motion is right within 60° of a set-point's direction, and not
        checked if the heading is unknown. A turn's direction is right if a set-point has the same.
        """
        x, y, rate = self.measured.vx_mps, self.measured.vy_mps, self.measured.yaw_rate_radps
        if not self._error.way_exceeded:
            right = any(yaw * rate > 0.0 for _, _, yaw in explained)
            return Fault.TURNS_TOO_FAST if right else Fault.WRONG_TURN
        right = any(
            vx * x + vy * y > COSINE_60 * math.hypot(vx, vy) * math.hypot(x, y)
            for vx, vy, _ in explained
        )
        return Fault.TOO_FAST if right or not heading_known else Fault.WRONG_WAY

    def _unbidden(self, seconds: float, *, begins: bool) -> Fault | None:
        """Return UNCOMMANDED if the robot moves without a command and Stop is due; otherwise None.

        While the motion continues, Stop is due at longer and longer intervals. ``begins``: whether
        the following error exceeds its limit, which begins the fault.
        """
        if not self._error.outside:
            self._stood_s += seconds
            if self._stood_s >= STOOD_S:
                self._has_stood = True
                self._moved_s = self._stop_again_s = 0.0
            return None
        self._stood_s = 0.0
        if not (begins or self._stop_again_s):
            return None
        self._moved_s += seconds
        if self._moved_s < self._stop_again_s:
            return None
        # somebody may be pushing the robot, so Stop is repeated less and less often
        self._stop_again_s = STOPS_S + (self._moved_s if not self._has_stood else 2 * self._moved_s)
        return Fault.UNCOMMANDED

    def _blocked(self, motion: BodyTwist, seconds: float, *, heading_known: bool) -> Fault | None:
        """Return the fault of a robot that has not moved for 1 s despite a command, or None."""
        current = self._history.current
        assert current is not None
        wanted, turning = speed_of(current), current.yaw_rate_radps
        if wanted <= PLAIN_MPS and abs(turning) <= PLAIN_RADPS:
            self._blocked_s = 0.0
            return None
        along = dot(motion, current) if heading_known else speed_of(motion) * wanted
        if (wanted > PLAIN_MPS and along > MOVING_MPS * wanted) or (
            abs(turning) > PLAIN_RADPS
            and motion.yaw_rate_radps * turning > MOVING_RADPS * abs(turning)
        ):
            self._blocked_s = 0.0
            self._released, self._told = False, set()
            return None
        self._blocked_s += seconds
        if self._blocked_s < BLOCKED_S:
            return None
        self._blocked_s = 0.0
        return Fault.HELD_BY_ESTOP if self._released else Fault.BLOCKED
