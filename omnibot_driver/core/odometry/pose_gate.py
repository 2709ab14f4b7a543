# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Which of the board's poses to believe: one that is finite, reachable and no surprise.

A surprise must be confirmed by the next pose. Knows poses, speeds and what open gaps explain; not
what comes of a belief.
"""

import math
from typing import Final

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.odometry.covariance import Covariance
from omnibot_driver.core.odometry.pending_displacements import advanced
from omnibot_driver.core.readings import DisplacementReading

BELIEVED_M: Final = 0.02
BELIEVED_TURN_RAD: Final = 0.05
"""A pose that is off by more than this and what the gaps explain must be confirmed by the next."""
BELIEVED_SIGMAS: Final = 3.0
FARTHEST_M: Final = 1e5
FARTHEST_RAD: Final = 1e5
"""Beyond 100 km or 16,000 turns a pose is other bytes misread."""


class PoseGate:
    """``doubted`` is the last surprise, moved on with the robot since."""

    def __init__(self) -> None:
        self.refused = 0
        """Poses that are not possible, or that the next one did not confirm."""
        self.proved: Pose | None = None
        self.doubted: Pose | None = None
        self._unproved_s = 0.0

    def displaced(self, reading: DisplacementReading) -> None:
        """Move the expected pose by a reported motion."""
        if self.doubted is not None:
            self.doubted = advanced(self.doubted, reading)

    def bridged(self, chord: Pose) -> None:
        """Move the expected pose by an assumed motion, in the board's axes."""
        if self.doubted is not None:
            self.doubted = self.doubted.moved(chord)

    def passed(self, seconds: float) -> None:
        """Note that this time of the board has passed."""
        self._unproved_s += seconds

    def possible(self, told: Pose) -> bool:
        """Whether it is finite and within reach of any robot."""
        possible = told.finite and told.way_m < FARTHEST_M and abs(told.yaw_rad) < FARTHEST_RAD
        self.refused += not possible
        return possible

    def confirmed(self, told: Pose, gap: Covariance) -> bool:
        """Whether it confirms the doubted pose before it; otherwise that one is rejected."""
        doubted, self.doubted = self.doubted, None
        confirmed = doubted is not None and expected(doubted.way_to(told), gap)
        self.refused += doubted is not None and not confirmed
        return confirmed

    def believe(self, board: Pose) -> None:
        """Accept this pose of the board."""
        self.proved, self.doubted, self._unproved_s = board, None, 0.0

    def reachable(self, told: Pose, seconds: float, mps: float, radps: float) -> bool:
        """Whether the pose can be reached from the last accepted one, at these speeds."""
        if self.proved is None:
            return False
        way = self.proved.way_to(told)
        seconds += self._unproved_s
        return (
            way.way_m <= BELIEVED_M + mps * seconds
            and abs(way.yaw_rad) <= BELIEVED_TURN_RAD + radps * seconds
        )


def expected(way: Pose, gap: Covariance) -> bool:
    """Whether rounding and open gaps explain this deviation."""
    metres = math.sqrt(gap.xx + gap.yy) * BELIEVED_SIGMAS
    turn = math.sqrt(gap.yaw_yaw) * BELIEVED_SIGMAS
    return way.way_m <= BELIEVED_M + metres and abs(way.yaw_rad) <= BELIEVED_TURN_RAD + turn
