# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Wind-up: the extra distance that wheel controllers drive after the robot was held or pushed.

The wheel controllers integrate their errors while the robot is held or pushed. So when the robot is
released, it moves too fast or backwards, even after another command or Stop.

Other modules compute which velocities the set-points allow.
"""

import math
from collections.abc import Sequence
from typing import Final

from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.motion_monitor.envelope import STRETCH, dot, speed_of
from omnibot_driver.core.motion_monitor.set_point_history import AT_REST

MOST_M: Final = 0.6
"""Largest assumed wind-up, as the extra distance in m that the wheel controllers drive.

With this wind-up, the integrators of the wheel controllers are at their limits.
"""
LONG_S: Final = 0.06
"""Duration in s above which a displacement is regarded as long.

A single long displacement does not prove that the robot is held: the robot may have changed its
direction during this time.
"""
FORGOTTEN_S: Final = 6.0
FORGOTTEN_AT_REST_S: Final = 20.0
"""``FORGOTTEN_S``, ``FORGOTTEN_AT_REST_S``: time constants of the wind-up's decay, in s.

``FORGOTTEN_AT_REST_S`` applies while the set-point is rest, because someone may then hold the
robot, and the wind-up lasts longer.
"""
HELD_PART: Final = 0.7
"""A robot that is slower than this fraction of its recent set-points is regarded as held."""
BACK_MPS: Final = 0.01
BACK_RADPS: Final = 0.025
"""``BACK_MPS``, ``BACK_RADPS``: largest backward speeds of a held robot, in m/s and rad/s.

A robot that moves backward faster is not regarded as held, so its wind-up does not grow.
"""
LEVER_M: Final = 0.15
"""Approximate distance in m of the wheels from the robot's centre. It converts a yaw rate to the
speed of a wheel."""


class WindUp:
    """The wind-up of one robot.

    ``way_m``: the wind-up as a distance in m, at the rim of a wheel. The wheel controllers may
    still drive this distance in addition to the commanded motion.
    """

    def __init__(self) -> None:
        self.way_m = 0.0
        self._unproved_m: float | None = None
        """Wind-up in m of the last displacement, which ``way_m`` does not contain yet.

        This wind-up is added to ``way_m`` if the robot is also held in the next displacement. 0:
        ``way_m`` contains all wind-up. None: the robot was not held in the last displacement.
        """

    def pay(self, way_mps: float, turn_radps: float, seconds: float) -> bool:
        """Subtract a motion's excess from the wind-up; return whether the wind-up was large enough.

        ``way_mps``, ``turn_radps``: by how much the motion exceeds the allowed velocities.
        ``seconds``: duration of the motion.
        """
        self._unproved_m = None
        outside_m = (max(0.0, way_mps) + LEVER_M * max(0.0, turn_radps)) * seconds
        explained = outside_m < self.way_m
        self.way_m = max(0.0, self.way_m - outside_m)
        return explained

    def carry(self, motion: BodyTwist, seconds: float) -> None:
        """Add to the wind-up the distance by which someone moves the robot by hand.

        Call this method only while the set-point is zero.
        """
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
        """Increase the wind-up by the distance that a held robot falls behind its set-point.

        * If the robot is not held, the wind-up decays.
        * ``motion``: measured mean twist during ``seconds``. Call this method only if the
          set-points allow this twist.
        * ``newest``: set-points that the robot may still be approaching, the current one first.
        * ``heading_known``: if False, the direction of the linear velocity is not checked.
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
            # one long displacement does not prove that the robot was held
            self._unproved_m = lost_mps * seconds
        else:
            self.way_m = min(MOST_M, self.way_m + (self._unproved_m or 0.0) + lost_mps * seconds)
            self._unproved_m = 0.0
