# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The robot's pose in the board's frame, and whether the board still uses that frame.

A board that restarts begins a new frame at the robot's place. This module does not know the
odometry frame.
"""

from typing import Final

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.odometry.covariance import NOTHING, Covariance
from omnibot_driver.core.odometry.pose_gate import PoseGate, expected

BEGUN_M: Final = 0.005
BEGUN_RAD: Final = 0.01
"""``BEGUN_M``, ``BEGUN_RAD``: tolerances, in m and rad, of a pose that shows a new board frame.

The pose must be this near to the pose that is expected if the board has begun at zero. A pose in
the old frame is rarely so near.
"""


class BoardFrame:
    """The board's frame, as its poses have shown it.

    * ``pose``: the robot's pose in this frame; None while the frame is unknown.
    * ``since_restart``: motion since a suspected restart of the board; None if no restart is
      suspected.
    * ``gate``: decides which poses of the board are accepted.
    """

    def __init__(self) -> None:
        self.pose: Pose | None = None
        self.since_restart: Pose | None = None
        self.gate = PoseGate()

    @property
    def is_away(self) -> bool:
        """Whether the robot is away from the origin of the board's frame."""
        return self.pose is not None and not expected(self.pose, NOTHING)

    def suspect_restart(self) -> None:
        """Suspect that the board has restarted just now, and so has begun a new frame."""
        self.since_restart, self.gate.doubted = Pose(), None

    def begin_at(self, pose: Pose) -> None:
        """Adopt the frame in which the robot is at ``pose`` now."""
        self.pose, self.since_restart, self.gate.doubted = pose, None, None

    def forget(self) -> None:
        """Forget the robot's pose; the board's next poses must show it again."""
        self.pose = self.gate.proved = None

    def continues(self, told: Pose, gap: Covariance) -> bool:
        """Return whether the board's frame continues, although the pose counter began anew.

        If True, the pose was damaged: a restart would have lost displacements. ``gap``: covariance
        of the motion lost since the last accepted pose.
        """
        if self.pose is None or self.since_restart is not None:
            return False
        # a restart takes longer than a period, so displacements are lost
        return gap == NOTHING and expected(self.pose.way_to(told), gap)

    def was_replaced(
        self, told: Pose, before: Pose, gap: Covariance, *, confirmed: bool, reachable: bool
    ) -> bool:
        """Return whether the pose ``told`` shows that the board has begun a new frame.

        * If ``told`` refutes the suspected restart, the suspicion ends.
        * ``before``: the pose before the waiting displacements, computed back from ``told``.
        * ``confirmed``: whether ``told`` agrees with the last unexpected pose of the board.
        * ``reachable``: whether the robot can have reached ``told`` without a restart.
        """
        assert self.pose is not None
        assert self.since_restart is not None
        # the board's pose is zero at a restart
        anew = self.since_restart.way_to(told)
        went_on = self.pose.way_to(before)
        if expected(anew, gap) and _size(anew) < _size(went_on):
            return True
        if expected(went_on, gap) or (confirmed and reachable):
            self.since_restart = None
            return False
        return confirmed


def is_begun(deviation: Pose) -> bool:
    """Return whether a pose shows by its value alone that the board began a new frame.

    ``deviation``: difference from the pose that is expected if the board began at zero.
    """
    return deviation.way_m <= BEGUN_M and abs(deviation.yaw_rad) <= BEGUN_RAD


def _size(way: Pose) -> float:
    return way.way_m + abs(way.yaw_rad)
