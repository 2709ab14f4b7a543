# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The gate for the board's poses: accepts a pose that is finite, reachable and as expected.

An unexpected pose is accepted only if the next pose confirms it. This module does not know what an
accepted pose changes.
"""

import math
from typing import Final

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.odometry.covariance import Covariance
from omnibot_driver.core.odometry.gap_interpolation import LONGEST_BRIDGE_S
from omnibot_driver.core.odometry.pending_displacements import advanced
from omnibot_driver.core.readings import DisplacementReading

BELIEVED_M: Final = 0.02
BELIEVED_TURN_RAD: Final = 0.05
"""``BELIEVED_M``, ``BELIEVED_TURN_RAD``: limits for a pose's deviation, in m and rad.

A pose that deviates more from the expected one must be confirmed by the next pose. After losses,
the limits are larger until a pose is accepted.
"""
BELIEVED_SIGMAS: Final = 3.0
FARTHEST_M: Final = 1e5
FARTHEST_RAD: Final = 1e5
"""``FARTHEST_M``, ``FARTHEST_RAD``: limits of a plausible pose, in m and rad. If a pose is
beyond 100 km or 16,000 turns, its bytes were misread."""


class PoseGate:
    """Decides which poses of the board are accepted.

    * ``proved``: the last accepted pose; None if there is none that is still valid.
    * ``doubted``: the last unexpected pose, plus each later motion of the robot. The next pose
      must confirm it. None if there is no such pose.
    """

    def __init__(self) -> None:
        self.refused = 0
        """Number of rejected poses. They are of two kinds: poses that are impossible, and
        unexpected poses that the next pose has not confirmed."""
        self.proved: Pose | None = None
        self.doubted: Pose | None = None
        self._unproved_s = 0.0

    def displaced(self, reading: DisplacementReading, *, bridges: bool) -> None:
        """Add a reported motion of the robot to ``doubted``, a pose that must still be confirmed.

        ``bridges``: whether to add also the displacements lost just before ``reading``, each
        assumed equal to ``reading``. If False, the caller adds them with ``bridged``.
        """
        if self.doubted is None:
            return
        if bridges and reading.duration_s:
            for _ in range(min(reading.lost, round(LONGEST_BRIDGE_S / reading.duration_s))):
                self.doubted = advanced(self.doubted, reading)
        self.doubted = advanced(self.doubted, reading)

    def bridged(self, chord: Pose) -> None:
        """Add the robot's motion in a gap to ``doubted``, a pose that must still be confirmed.

        ``chord``: the motion that is assumed for the gap, in the axes of the pose ``doubted``.
        """
        if self.doubted is not None:
            self.doubted = self.doubted.moved(chord)

    def passed(self, seconds: float) -> None:
        """Add ``seconds``, by the board's clock, to the time since the last accepted pose.

        In this time, the robot may have moved.
        """
        self._unproved_s += seconds

    def possible(self, told: Pose) -> bool:
        """Return whether a pose is finite and below the limits. If not, count it as rejected."""
        possible = told.finite and told.way_m < FARTHEST_M and abs(told.yaw_rad) < FARTHEST_RAD
        self.refused += not possible
        return possible

    def confirmed(self, told: Pose, gap: Covariance) -> bool:
        """Return whether the pose ``told`` confirms ``doubted``, the last unexpected pose.

        Afterwards, ``doubted`` is None; if it was not confirmed, it counts as rejected. ``gap``:
        covariance of the motion lost since the last accepted pose.
        """
        doubted, self.doubted = self.doubted, None
        confirmed = doubted is not None and expected(doubted.way_to(told), gap)
        self.refused += doubted is not None and not confirmed
        return confirmed

    def believe(self, board: Pose) -> None:
        """Record that this pose of the board was accepted."""
        self.proved, self.doubted, self._unproved_s = board, None, 0.0

    def reachable(self, told: Pose, seconds: float, mps: float, radps: float) -> bool:
        """Return whether the robot can have reached the pose ``told`` since the last accepted pose.

        False without an accepted pose. ``seconds``: possible time of motion in s, in addition to
        the time recorded with ``passed``. ``mps``, ``radps``: largest speeds.
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
    """Return whether rounding or lost displacements can explain the deviation of a pose.

    ``way``: deviation from the expected pose. ``gap``: covariance of the motion lost since the last
    accepted pose.
    """
    metres = math.sqrt(gap.xx + gap.yy) * BELIEVED_SIGMAS
    turn = math.sqrt(gap.yaw_yaw) * BELIEVED_SIGMAS
    return way.way_m <= BELIEVED_M + metres and abs(way.yaw_rad) <= BELIEVED_TURN_RAD + turn
