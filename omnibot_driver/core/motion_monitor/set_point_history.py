# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The history of set-points, and the velocities that the robot may have because of them.

For 0.3 s, a replaced set-point still allows its full velocity, and after that an ever smaller part.
This module knows velocities and times; it does not know how the robot moves.
"""

import math
from collections import deque
from typing import Final

from omnibot_driver.core.geometry.twist import BodyTwist

CommandedTwist = BodyTwist | None
"""A commanded twist, or None for a goal: the twist of a robot that goes to a goal is not known in
advance."""
AT_REST: Final = BodyTwist(0.0, 0.0, 0.0)

Velocity = tuple[float, float, float]
"""The three values of a BodyTwist as a tuple. The monitor needs many such values, and Python makes
a tuple faster than a BodyTwist."""

HELD_S: Final = 0.3
"""Time in s for which a robot may keep the full velocity of a replaced set-point.

This time includes the line's delay, a lost repetition, and a controller's dead time.
"""
FADING_S: Final = 0.2
"""Time constant, in s, of the decay of the velocity that a replaced set-point still allows.

The decay begins after ``HELD_S``. The value is long enough for robots with a time constant of up to
0.35 s.
"""
FADED_S: Final = 1.1
"""Time in s after which the monitor ignores a replaced set-point. By then, the velocity that this
set-point still allows has decayed to less than 2 %."""
UNKNOWN_S: Final = 0.8
"""Time in s after the first known set-point in which unknown earlier commands may still move the
robot."""
HISTORY_S: Final = 3.0
"""Length of the history in s. A displacement can be older than the history only if the computer has
stalled."""


class SetpointHistory:
    """The recent set-points of one robot.

    ``current``: the set-point that was added last.
    """

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Forget all earlier commands."""
        self.current: CommandedTwist = None
        self._entries: deque[tuple[float, BodyTwist]] = deque()
        self._known_from_s = math.inf

    def add(self, setpoint: CommandedTwist, at_s: float) -> None:
        """Add a set-point that holds from ``at_s`` on.

        For a robot at rest, pass the object ``AT_REST`` itself: the history recognises it by
        identity.
        """
        before, self.current = self.current, setpoint
        if setpoint is None:
            self._entries.clear()
            self._known_from_s = math.inf
            return
        if before is None:
            self._known_from_s = at_s + UNKNOWN_S
        elif before is setpoint or before == setpoint:
            return
        self._entries.append((at_s, setpoint))
        while len(self._entries) > 1 and self._entries[1][0] < at_s - HISTORY_S:
            self._entries.popleft()

    def known(self, at_s: float) -> bool:
        """Return whether all set-points that may affect the motion at ``at_s`` are known."""
        return at_s >= self._known_from_s

    def since(self, start_s: float) -> list[BodyTwist]:
        """Return the set-points that held at ``start_s`` or later, the newest first."""
        found = []
        for at_s, setpoint in reversed(self._entries):
            found.append(setpoint)
            if at_s <= start_s:
                break
        return found

    def driven(self, at_s: float) -> bool:
        """Return whether motion was commanded at ``at_s`` or at any time since then."""
        return any(each is not AT_REST for each in self.since(at_s))

    def explained(self, at_s: float) -> list[Velocity]:
        """Return the velocities that the robot may have at ``at_s`` because of its set-points.

        The first velocity in the list is the one of the current set-point.
        """
        found: list[Velocity] = []
        age_s = 0.0
        for begun_s, setpoint in reversed(self._entries):
            x, y, yaw = setpoint.vx_mps, setpoint.vy_mps, setpoint.yaw_rate_radps
            if age_s <= HELD_S:
                found.append((x, y, yaw))
            elif setpoint is not AT_REST:
                left = math.exp((HELD_S - age_s) / FADING_S)
                found.append((left * x, left * y, left * yaw))
            age_s = at_s - begun_s
            if age_s >= FADED_S:
                break
        return found
