# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The published pose. It approaches the corrected pose no faster than the robot could move.

This module does not know how the corrections are found.
"""

from typing import Final

from omnibot_driver.core.geometry.se2 import Pose

SPREAD_S: Final = 0.2
"""Time over which a correction is spread, in s: the period of the board's poses."""


class CorrectionSmoother:
    """Moves ``pose``, the published pose, towards ``target``, the best known pose.

    In each step, ``pose`` moves and turns at most as far as the robot could.
    """

    def __init__(self) -> None:
        self.pose = self.target = Pose()
        self._settling_s = 0.0
        self._room_m = self._room_rad = 0.0

    @property
    def wrong(self) -> Pose:
        """The correction that ``pose`` still needs: ``target`` minus ``pose``."""
        return self.target - self.pose

    def correct(self, chord: Pose, spread_s: float = SPREAD_S) -> None:
        """Move ``target`` by ``chord``, a correction in the axes of ``target``.

        ``follow`` then moves ``pose`` to ``target`` within ``spread_s``, or more slowly if the
        robot could not move so fast.
        """
        self.target = self.target.moved(chord)
        self._settling_s = spread_s

    def move(self, chord: Pose, room_m: float, room_rad: float) -> None:
        """Move ``pose`` and ``target`` by a displacement in the robot's own axes.

        ``room_m``, ``room_rad``: largest distance and angle that are possible for the robot in this
        step.
        """
        pose, target = self.pose, self.target
        self.target = target.moved(chord)
        self.pose = self.target if pose is target else pose.moved(chord)
        self._room_m += room_m - chord.way_m
        self._room_rad += room_rad - abs(chord.yaw_rad)

    def trail(self, chord: Pose, room_m: float, room_rad: float) -> None:
        """Move ``target``, the best known pose, by a displacement.

        Move ``pose``, the published pose, by the part of the displacement that the limits allow.

        ``room_m``, ``room_rad``: limits of the distance and the angle by which ``pose`` moves.
        """
        linear, angular = _part(chord.way_m, room_m), _part(abs(chord.yaw_rad), room_rad)
        behind = self.target.moved(chord)
        self.move(chord.times(linear, linear, angular), room_m, room_rad)
        self.target = behind

    def follow(self, seconds: float) -> None:
        """Move ``pose``, the published pose, a part of the way to ``target``, the best known pose.

        ``seconds``: duration of this step. In a step, ``move`` and ``follow`` together move
        ``pose`` at most as far as the robot could.
        """
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
    """Return the fraction, 0 to 1, of the wanted correction that ``room`` allows.

    ``room``: the most by which the pose may still move in this step.
    """
    return min(1.0, max(0.0, room) / wanted) if wanted else 1.0
