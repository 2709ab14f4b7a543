# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What was commanded when, and how much motion it explains now.

A robot follows a set-point late, and leaves it smoothly. So one that another has replaced explains
all of its velocity for ``HELD_S``, and then less and less. Knows velocities in the board's own
axes, and times; not how the robot moves.
"""

import math
from collections import deque
from typing import Final

from omnibot_driver.core.geometry.twist import BodyTwist

CommandedTwist = BodyTwist | None
"""A body velocity that was commanded; None: any motion is possible."""
AT_REST: Final = BodyTwist(0.0, 0.0, 0.0)

Velocity = tuple[float, float, float]
"""What a BodyTwist holds; many are made, and a plain tuple is made quickly."""

HELD_S: Final = 0.3
"""The line, a repetition that was lost, and a controller's dead time."""
FADING_S: Final = 0.2
"""Time constant afterwards; a robot whose own is 0.35 s stays within it."""
FADED_S: Final = 1.1
"""After this time a replaced set-point explains nothing: 2 % are left."""
UNKNOWN_S: Final = 0.8
"""Motion of which nothing is known is over by then."""
HISTORY_S: Final = 3.0
"""A computer that reads displacements later than this has stalled."""


class SetpointHistory:
    """The recent set-points. ``current`` holds since the last ``add``."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Forget all earlier commands."""
        self.current: CommandedTwist = None
        self._entries: deque[tuple[float, BodyTwist]] = deque()
        self._known_from_s = math.inf

    def add(self, setpoint: CommandedTwist, at_s: float) -> None:
        """``setpoint`` holds from this time on; at rest it is ``AT_REST`` itself."""
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
        """Whether set-points explain the robot's motion at this time."""
        return at_s >= self._known_from_s

    def since(self, start_s: float) -> list[BodyTwist]:
        """All that held at this time or later, the newest first."""
        found = []
        for at_s, setpoint in reversed(self._entries):
            found.append(setpoint)
            if at_s <= start_s:
                break
        return found

    def driven(self, at_s: float) -> bool:
        """Whether any set-point at this time or later is motion."""
        return any(each is not AT_REST for each in self.since(at_s))

    def explained(self, at_s: float) -> list[Velocity]:
        """The velocities that the robot may have at this time, by the current set-point (first) and
        those before it.
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
