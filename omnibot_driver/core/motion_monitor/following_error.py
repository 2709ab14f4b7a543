# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The following error: how far a robot has moved in a way that its set-points do not allow.

The *envelope* is the set of velocities that recent set-points allow (``envelope.py``). The error is
the sum of the motion outside the envelope. A displacement inside the envelope resets the error to
0. This module knows velocities in the board's own axes, and times; it does not know which fault an
error shows.
"""

from typing import Final

from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.motion_monitor.envelope import on_the_way, outside
from omnibot_driver.core.motion_monitor.set_point_history import AT_REST, SetpointHistory
from omnibot_driver.core.motion_monitor.wind_up import LONG_S, WindUp

RISING_S: Final = 0.16
"""Longest time in s that a robot needs to follow a set-point.

A robot is assumed to be held if it is clearly slower than all set-points of a displacement and of
the RISING_S before the displacement.
"""
UNEXPLAINED_M: Final = 0.003
UNEXPLAINED_RAD: Final = 0.01
LARGEST_PART, LARGEST_PART_OF_A_LONG_ONE = 0.45, 0.55
"""``LARGEST_PART``: largest fraction of the error's limit that one displacement adds.

For displacements over 60 ms, ``LARGEST_PART_OF_A_LONG_ONE`` applies. So only three displacements in
a row, or two long ones, can exceed the limit.
"""


class FollowingError:
    """The following error of one robot: the sum of its motion beyond what its set-points allow.

    * ``slack_mps``, ``slack_radps``: tolerated excess of a velocity, in m/s and rad/s.
    * ``outside``: whether the last displacement's excess was above the slack.
    """

    def __init__(self, slack_mps: float = 0.0, slack_radps: float = 0.0) -> None:
        self._slack_mps, self._slack_radps = slack_mps, slack_radps
        self.reset()

    def reset(self) -> None:
        """Forget all motion so far."""
        self._wind_up = WindUp()
        self._stands = True
        self.outside = False
        self._way_m = self._turn_rad = 0.0

    @property
    def exceeded(self) -> bool:
        """Whether the linear or the angular error is larger than its limit."""
        return self.way_exceeded or self._turn_rad > UNEXPLAINED_RAD

    @property
    def way_exceeded(self) -> bool:
        """Whether the linear error is larger than its limit."""
        return self._way_m > UNEXPLAINED_M

    def update(
        self,
        motion: BodyTwist,
        seconds: float,
        history: SetpointHistory,
        begun_s: float,
        *,
        heading_known: bool,
    ) -> None:
        """Add one displacement to the error, or reset the error if the set-points allow the motion.

        ``motion``: mean twist during ``seconds`` from ``begun_s`` on. ``heading_known``: if False,
        the linear velocity's direction is not checked.
        """
        newest = history.since(begun_s - RISING_S)
        way_mps = turn_radps = 0.0
        if not (heading_known and on_the_way(motion, newest)):
            explained = history.explained(begun_s)
            way_mps, turn_radps = outside(motion, explained, heading_known=heading_known)
            way_mps -= self._slack_mps
            turn_radps -= self._slack_radps
        stood, self._stands = self._stands, newest[0] is AT_REST
        if self._stands is not stood:
            self._way_m = self._turn_rad = 0.0
        self.outside = way_mps > 0.0 or turn_radps > 0.0
        if not self.outside:
            self._way_m = self._turn_rad = 0.0
            self._wind_up.follow(motion, seconds, newest, heading_known=heading_known)
        elif self._stands and self.exceeded:
            self._wind_up.carry(motion, seconds)
        elif self._wind_up.pay(way_mps, turn_radps, seconds):
            self._way_m = self._turn_rad = 0.0
        else:
            part = LARGEST_PART_OF_A_LONG_ONE if seconds > LONG_S else LARGEST_PART
            most_m, most_rad = part * UNEXPLAINED_M, part * UNEXPLAINED_RAD
            self._way_m = _sum(self._way_m, way_mps * seconds, most_m)
            self._turn_rad = _sum(self._turn_rad, turn_radps * seconds, most_rad)


def _sum(before: float, outside: float, most: float) -> float:
    return before + min(outside, most) if outside > 0.0 else 0.0
