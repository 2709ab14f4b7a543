# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The gate for the board's poses: accepts one that is finite, reachable and as expected.

An unexpected pose must be confirmed by the next one. Knows poses, speeds and what open gaps
explain; not what an accepted pose changes.
"""

import math
from typing import Final

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.odometry.covariance import Covariance
from omnibot_driver.core.odometry.pending_displacements import advanced
from omnibot_driver.core.readings import DisplacementReading

BELIEVED_M: Final = 0.02
BELIEVED_TURN_RAD: Final = 0.05
"""Deviations, on top of what open gaps explain, above which the next pose must confirm a pose."""
BELIEVED_SIGMAS: Final = 3.0
FARTHEST_M: Final = 1e5
FARTHEST_RAD: Final = 1e5
"""Limits of a plausible pose: beyond 100 km or 16,000 turns it is made of misread bytes."""


class PoseGate:
    """The state of the gate.

    * ``proved``: the last accepted pose; None before the first, and after it has become invalid.
    * ``doubted``: the last unexpected pose, moved along with the robot since.
    """

    def __init__(self) -> None:
        self.refused = 0
        """Number of poses that were impossible, or that the next pose did not confirm."""
        self.proved: Pose | None = None
        self.doubted: Pose | None = None
        self._unproved_s = 0.0

    def displaced(self, reading: DisplacementReading) -> None:
        """Move the doubted pose along with a reported motion."""
        if self.doubted is not None:
            self.doubted = advanced(self.doubted, reading)

    def bridged(self, chord: Pose) -> None:
        """Move the doubted pose along with an assumed motion, in the board's axes."""
        if self.doubted is not None:
            self.doubted = self.doubted.moved(chord)

    def passed(self, seconds: float) -> None:
        """Note that this much time of the board has passed, in s."""
        self._unproved_s += seconds

    def possible(self, told: Pose) -> bool:
        """Return whether the pose is finite and within reach of any robot; count it if not."""
        possible = told.finite and told.way_m < FARTHEST_M and abs(told.yaw_rad) < FARTHEST_RAD
        self.refused += not possible
        return possible

    def confirmed(self, told: Pose, gap: Covariance) -> bool:
        """Return whether the pose confirms the doubted pose; otherwise reject the doubted pose."""
        doubted, self.doubted = self.doubted, None
        confirmed = doubted is not None and expected(doubted.way_to(told), gap)
        self.refused += doubted is not None and not confirmed
        return confirmed

    def believe(self, board: Pose) -> None:
        """Accept this pose of the board."""
        self.proved, self.doubted, self._unproved_s = board, None, 0.0

    def reachable(self, told: Pose, seconds: float, mps: float, radps: float) -> bool:
        """Return whether the pose can be reached from the last accepted one, at these speeds.

        ``seconds``: time in addition to that noted by ``passed``.
        """
        if self.proved is None:
            return False
        way = self.proved.way_to(told)
        seconds += self._unproved_s
        return (
            way.way_m <= BELIEVED_M + mps * seconds
            and abs(way.yaw_rad) <= BELIEVED_TURN_RAD + radps * seconds
        )


def expected(way: Pose, gap: Covariance) -> bool:
    """Return whether rounding and open gaps explain this deviation."""
    metres = math.sqrt(gap.xx + gap.yy) * BELIEVED_SIGMAS
    turn = math.sqrt(gap.yaw_yaw) * BELIEVED_SIGMAS
    return way.way_m <= BELIEVED_M + metres and abs(way.yaw_rad) <= BELIEVED_TURN_RAD + turn
