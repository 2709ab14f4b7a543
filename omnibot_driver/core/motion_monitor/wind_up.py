# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The wind-up of wheel controllers while a robot is held or pushed, and the motion it explains.

The wheel controllers integrate their errors. A robot that is held falls behind its set-point; a
robot whose set-point is rest may be pushed away. Once released, the robot makes up for the lost
distance: it moves faster than commanded, or backwards, even if the command has changed
meanwhile or is a stop. This module knows velocities; it does not know what is inside the envelope.
"""

import math
from collections.abc import Sequence
from typing import Final

from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.motion_monitor.envelope import STRETCH, dot, speed_of
from omnibot_driver.core.motion_monitor.set_point_history import AT_REST

MOST_M: Final = 0.6
"""Largest distance in m that a robot is assumed to make up for. The integrators of the wheel
controllers are assumed to be at their limits then."""
LONG_S: Final = 0.06
"""Duration in s above which a displacement is regarded as long.

A single long displacement does not prove that the robot is held: the robot may have reversed.
"""
FORGOTTEN_S: Final = 6.0
FORGOTTEN_AT_REST_S: Final = 20.0
"""``FORGOTTEN_S``, ``FORGOTTEN_AT_REST_S``: time constants in s with which the wind-up is
forgotten, in motion and at rest.

It is forgotten more slowly at rest, because a robot that is still held keeps its wind-up.
"""
HELD_PART: Final = 0.7
"""A robot whose speed is below this fraction of its set-points is regarded as held."""
BACK_MPS: Final = 0.01
BACK_RADPS: Final = 0.025
"""``BACK_MPS``, ``BACK_RADPS``: speeds against the set-point, in m/s and rad/s, above which a robot
is not regarded as held.

Faster motion against the set-point does not add to the wind-up.
"""
LEVER_M: Final = 0.15
"""Approximate distance in m of the wheels from the centre: converts a turn to rim motion."""


class WindUp:
    """The wind-up of a robot's wheels. ``way_m``: distance in m at a rim that the robot may still
    make up for."""

    def __init__(self) -> None:
        self.way_m = 0.0
        self._unproved_m: float | None = None
        """Distance in m by which the robot fell behind in one long displacement. It is added to
        ``way_m`` only if the robot is held in the next displacement too.

        0: the distance has been added. None: the robot was not held in the last displacement.
        """

    def pay(self, way_mps: float, turn_radps: float, seconds: float) -> bool:
        """Subtract motion outside the envelope from ``way_m``; return whether that explains it.

        The wind-up explains motion that is shorter than ``way_m``, in any direction. ``way_mps``,
        ``turn_radps``: speeds outside the envelope, which lasted for ``seconds``.
        """
        self._unproved_m = None
        outside_m = (max(0.0, way_mps) + LEVER_M * max(0.0, turn_radps)) * seconds
        explained = outside_m < self.way_m
        self.way_m = max(0.0, self.way_m - outside_m)
        return explained

    def carry(self, motion: BodyTwist, seconds: float) -> None:
        """Add the motion of a robot that is moved by hand while its set-point is rest."""
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
        """Add the distance by which a held robot falls behind; else slowly forget the wind-up.

        ``motion``: motion inside the envelope. ``newest``: the set-points that the robot may not
        have reached yet, the current one first.
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
