# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The wind-up of wheel controllers that somebody works against, and the way that it explains.

They integrate: what a robot loses against its set-point while it is held, or is moved while it is
to stand, they make good when it is released; faster than commanded, or back, also by a command
that has changed meanwhile, and also when it is to stop. Knows velocities; not what is inside the
envelope.
"""

import math
from collections.abc import Sequence
from typing import Final

from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.motion_monitor.envelope import STRETCH, dot, speed_of
from omnibot_driver.core.motion_monitor.set_point_history import AT_REST

MOST_M: Final = 0.6
"""More than the integrators hold at full effort is not made good."""
LONG_S: Final = 0.06
"""One displacement of this length proves no hold: the robot may have turned round within it."""
FORGOTTEN_S: Final = 6.0
FORGOTTEN_AT_REST_S: Final = 20.0
"""A robot that is to stand, and stands, may still be held: nothing unwinds."""
HELD_PART: Final = 0.7
"""A robot that does not reach this part of its set-points is held by something..."""
BACK_MPS: Final = 0.01
BACK_RADPS: Final = 0.025
"""... but not one that goes the other way faster than this: that explains nothing."""
LEVER_M: Final = 0.15
"""About the distance of the wheels from the centre: what a turn is worth at a rim."""


class WindUp:
    """``way_m``: what is to be made good, at a rim."""

    def __init__(self) -> None:
        self.way_m = 0.0
        self._unproved_m: float | None = None
        """Lost in a first long displacement, until the next one; None: not held in the last one."""

    def pay(self, way_mps: float, turn_radps: float, seconds: float) -> bool:
        """Whether motion outside of the envelope, by this amount and for this time, is
        explained."""
        self._unproved_m = None
        outside_m = (max(0.0, way_mps) + LEVER_M * max(0.0, turn_radps)) * seconds
        explained = outside_m < self.way_m
        self.way_m = max(0.0, self.way_m - outside_m)
        return explained

    def carry(self, motion: BodyTwist, seconds: float) -> None:
        """Note that a robot without a command is being moved by hand."""
        moved_mps = speed_of(motion) + LEVER_M * abs(motion.yaw_rate_radps)
        self.way_m = min(MOST_M, self.way_m + moved_mps * seconds)

    def follow(
        self,
        motion: BodyTwist,
        seconds: float,
        newest: Sequence[BodyTwist],
        *,
        heading_known: bool,
    ) -> None:
        """Move inside of the envelope, held or not.

        ``newest``: the set-points that the robot may not have reached yet, the current one first.
        """
        current, lost_mps = newest[0], 0.0
        if current is AT_REST and not self.way_m:
            return
        if wanted := speed_of(current):
            along = dot(motion, current) / wanted if heading_known else speed_of(motion)
            least = min(dot(each, current) for each in newest) / wanted
            if -BACK_MPS < along < HELD_PART * least:
                lost_mps = STRETCH * wanted - max(0.0, along)
        if rate := current.yaw_rate_radps:
            along = math.copysign(motion.yaw_rate_radps, motion.yaw_rate_radps * rate)
            least = min(each.yaw_rate_radps * rate for each in newest) / abs(rate)
            if -BACK_RADPS < along < HELD_PART * least:
                lost_mps += LEVER_M * (STRETCH * abs(rate) - max(0.0, along))
        if not lost_mps:
            self._unproved_m = None
            forgotten_s = FORGOTTEN_AT_REST_S if current is AT_REST else FORGOTTEN_S
            self.way_m *= math.exp(-seconds / forgotten_s)
        elif self._unproved_m is None and seconds > LONG_S:
            self._unproved_m = lost_mps * seconds
        else:
            self.way_m = min(MOST_M, self.way_m + (self._unproved_m or 0.0) + lost_mps * seconds)
            self._unproved_m = 0.0
