# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The gate for the board's poses: accepts a pose that is finite, reachable and as expected.

An unexpected pose is accepted only if the next pose confirms it. This module does not know what an
accepted pose changes.
"""

import math
from typing import Final

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.odometry.covariance import Covariance
from omnibot_driver.core.odometry.pending_displacements import advanced
from omnibot_driver.core.readings import DisplacementReading

BELIEVED_M: Final = 0.02
BELIEVED_TURN_RAD: Final = 0.05
"""``BELIEVED_M``, ``BELIEVED_TURN_RAD``: largest deviations from the expected pose, in m and rad,
with which a pose is accepted at once. A pose that deviates more must be confirmed by the next one.

The limits are larger after displacements were lost: the possible motion of these displacements
is added until a pose has shown their motion.
"""
BELIEVED_SIGMAS: Final = 3.0
FARTHEST_M: Final = 1e5
FARTHEST_RAD: Final = 1e5
"""``FARTHEST_M``, ``FARTHEST_RAD``: limits of a plausible pose, in m and rad. A pose beyond 100 km
or 16,000 turns comes from misread bytes."""


class PoseGate:
    """Decides which poses of the board are accepted.

    * ``proved``: the last accepted pose; None if there is no valid one.
    * ``doubted``: the unexpected pose that the next pose must confirm, moved along with the robot;
      None if there is none.
    """

    def __init__(self) -> None:
        self.refused = 0
        """Number of poses that were impossible, or unexpected and not confirmed by the next one."""
        self.proved: Pose | None = None
        self.doubted: Pose | None = None
        self._unproved_s = 0.0

    def displaced(self, reading: DisplacementReading) -> None:
        """Move the unconfirmed pose ``doubted`` along with a reported motion of the robot."""
        if self.doubted is not None:
            self.doubted = advanced(self.doubted, reading)

    def bridged(self, chord: Pose) -> None:
        """Move the unconfirmed pose ``doubted`` by the motion that is assumed for a gap.

        ``chord``: this motion, in the axes of ``doubted``.
        """
        if self.doubted is not None:
            self.doubted = self.doubted.moved(chord)

    def passed(self, seconds: float) -> None:
        """Record that the robot may have moved for ``seconds``, by the board's clock."""
        self._unproved_s += seconds

    def possible(self, told: Pose) -> bool:
        """Return whether a pose is finite and below the limits. If not, count it as refused."""
        possible = told.finite and told.way_m < FARTHEST_M and abs(told.yaw_rad) < FARTHEST_RAD
        self.refused += not possible
        return possible

    def confirmed(self, told: Pose, gap: Covariance) -> bool:
        """Return whether the new pose ``told`` agrees with ``doubted``, the last unexpected pose.

        If there is no ``doubted`` pose, the result is False. If the two poses do not agree,
        ``doubted`` is counted as refused. After this call, there is no ``doubted`` pose.

        ``gap``: covariance of the motion of lost displacements that no pose has shown yet. It
        increases the tolerated difference.
        """
        doubted, self.doubted = self.doubted, None
        confirmed = doubted is not None and expected(doubted.way_to(told), gap)
        self.refused += doubted is not None and not confirmed
        return confirmed

    def believe(self, board: Pose) -> None:
        """Record that this pose of the board was accepted."""
        self.proved, self.doubted, self._unproved_s = board, None, 0.0

    def reachable(self, told: Pose, seconds: float, mps: float, radps: float) -> bool:
        """Return whether the robot can have reached a pose since the last accepted one.

        The result is False if no pose was accepted yet.

        ``seconds``: time in s in addition to the time that ``passed`` has recorded.

        ``mps``, ``radps``: largest speeds of the robot, in m/s and rad/s.
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
    """Return whether rounding or lost displacements can explain a pose's deviation.

    ``way``: the deviation from the expected pose.

    ``gap``: covariance of the motion of the displacements that were lost since the last pose.
    """
    metres = math.sqrt(gap.xx + gap.yy) * BELIEVED_SIGMAS
    turn = math.sqrt(gap.yaw_yaw) * BELIEVED_SIGMAS
    return way.way_m <= BELIEVED_M + metres and abs(way.yaw_rad) <= BELIEVED_TURN_RAD + turn
