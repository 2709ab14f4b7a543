# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The pose that is given out: moves with the robot, and nears the truth no faster than it could.

Knows poses and speeds; not how the truth is found.
"""

from typing import Final

from omnibot_driver.core.geometry.se2 import Pose

SPREAD_S: Final = 0.2
"""Time over which a correction is spread: that from one pose of the board to the next."""


class CorrectionSmoother:
    """``pose`` follows ``target``. What the robot could have moved and did not is room for it."""

    def __init__(self) -> None:
        self.pose = self.target = Pose()
        self._settling_s = 0.0
        self._room_m = self._room_rad = 0.0

    @property
    def wrong(self) -> Pose:
        """The known error of ``pose``."""
        return self.target - self.pose

    def correct(self, chord: Pose, spread_s: float = SPREAD_S) -> None:
        """Move the target by this displacement, in its own axes."""
        self.target = self.target.moved(chord)
        self._settling_s = spread_s

    def move(self, chord: Pose, room_m: float, room_rad: float) -> None:
        """Move the robot, in its own axes; ``room`` is the most that it can have moved."""
        pose, target = self.pose, self.target
        self.target = target.moved(chord)
        self.pose = self.target if pose is target else pose.moved(chord)
        self._room_m += room_m - chord.way_m
        self._room_rad += room_rad - abs(chord.yaw_rad)

    def trail(self, chord: Pose, room_m: float, room_rad: float) -> None:
        """The same, but what exceeds the limit is applied later."""
        linear, angular = _part(chord.way_m, room_m), _part(abs(chord.yaw_rad), room_rad)
        behind = self.target.moved(chord)
        self.move(chord.times(linear, linear, angular), room_m, room_rad)
        self.target = behind

    def follow(self, seconds: float) -> None:
        """Approach the target by this step's share, as far as there is room."""
        wrong = self.wrong
        share = seconds / self._settling_s if self._settling_s > seconds else 1.0
        self._settling_s = max(0.0, self._settling_s - seconds)
        if wrong.x_m or wrong.y_m or wrong.yaw_rad:
            linear = min(share, _part(wrong.way_m, self._room_m))
            angular = min(share, _part(abs(wrong.yaw_rad), self._room_rad))
            self.pose += wrong.times(linear, linear, angular)
        else:
            self.pose = self.target
        self._room_m = self._room_rad = 0.0


def _part(wanted: float, room: float) -> float:
    """The part of the wanted correction that fits."""
    return min(1.0, max(0.0, room) / wanted) if wanted else 1.0
