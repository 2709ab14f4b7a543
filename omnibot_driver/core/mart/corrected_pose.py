# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The pose in the odometry frame, and how later knowledge of a motion corrects it.

For example, the server reports the angle of a finished turn. This module knows angles and
distances; it does not know counts or times.
"""

import math
from typing import Final

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.mart.doubt import Doubt
from omnibot_driver.core.mart.mean_speeds import MeanSpeeds
from omnibot_driver.core.mart.settings import MartSettings
from omnibot_driver.core.mart.turn_angle import TurnAngle

UNHEARD_M, UNHEARD_RAD = 0.4, 0.3
"""Assumed standard deviations of the robot's motion during a lost connection (not measured).

``UNHEARD_M``: position, in m. ``UNHEARD_RAD``: heading, in rad.
"""
ANY_RAD: Final = 1.8
"""Standard deviation of an unknown heading, in rad."""
RUN, END_RUN_M, END_RUN_RAD = 0.1, 0.04, math.radians(3.0)
"""Standard deviations of the assumed distance or turn in the first run of a move that ran twice.

``RUN``: as a fraction of this distance or turn. ``END_RUN_M``, ``END_RUN_RAD``: constant part, in m
and in rad.
"""


class CorrectedPose:
    """The pose of the robot, and its covariance.

    ``pose``: pose at the last encoder count, in the odometry frame.

    ``turn``: angle of the current or last turn on the spot.
    """

    def __init__(self, settings: MartSettings) -> None:
        self._settings = settings
        self.doubt = Doubt(settings)
        self.speeds = MeanSpeeds()
        self.turn = TurnAngle()
        self.pose = self.rolled = Pose()

    @property
    def settings(self) -> MartSettings:
        """The sizes and scales of the robot. The caller may replace them."""
        return self._settings

    @settings.setter
    def settings(self, settings: MartSettings) -> None:
        self._settings = self.doubt.settings = settings

    def spin_told(self, degrees: float) -> None:
        """Correct the heading by the angle that the server reports after a turn on the spot.

        ``degrees``: this angle, with the server's sign.
        """
        told_rad = math.radians(degrees) * self._settings.heading_scale
        self._correct_yaw(self.turn.tell(told_rad))

    def turn_recorded(self, degrees: float) -> bool:
        """Correct the heading after a controlled turn, with the angle in the server's record of it.

        ``degrees``: this angle, with the server's sign. Return whether the angle was used.
        """
        told_rad = math.radians(degrees) * self._settings.heading_scale
        spun_rad = self.turn.spun_rad
        wrong_rad = self.turn.record(told_rad)
        if wrong_rad is None:
            return False
        self._correct_yaw(wrong_rad)
        self.doubt.turn_recorded(spun_rad, told_rad)
        return True

    def run_before(self, is_straight: bool, amount: float) -> None:
        """Add the first of two runs of a controlled move. Only the second run was measured.

        ``amount``: the expected distance of a complete run in m, or its expected turn in rad.
        """
        if is_straight:
            self.pose = self.pose.moved(Pose(amount, 0.0, 0.0))
            self.rolled += Pose(amount, 0.0, 0.0)
            self.doubt.add(END_RUN_M**2 + (RUN * amount) ** 2, 0.0)
            self.doubt.end_straight()
        else:
            self._correct_yaw(amount)
            self.doubt.add(0.0, END_RUN_RAD**2 + (RUN * amount) ** 2)

    def lose_turn(self) -> None:
        """Increase the uncertainty, because the robot may have turned by an unknown angle.

        For example, the server restarts in a motion, while the motors run on.
        """
        self.doubt.add(UNHEARD_M**2, ANY_RAD**2)

    def doubt_turn(self, turn_rad: float) -> None:
        """Increase the uncertainty of the pose by a turn that was perhaps not measured.

        Only one wheel may have turned, so the position becomes uncertain too. ``turn_rad``: angle.
        """
        turn_rad = min(abs(turn_rad), ANY_RAD)
        self.doubt.add((turn_rad * self._settings.track_m / 2) ** 2, turn_rad**2)

    def _end_turn(self, *, may_be_recorded: bool) -> float:
        """End a turn on the spot: correct the heading, and return the correction in rad.

        If the server's angle is implausible, the encoder's angle replaces it. Otherwise, the
        correction is 0.
        """
        wrong_rad = self.turn.end(may_be_recorded=may_be_recorded)
        self._correct_yaw(wrong_rad)
        self.doubt_turn(wrong_rad)
        self.doubt.end_turn(self.turn.spun_rad, self.turn.told_rad)
        return wrong_rad

    def _correct_yaw(self, wrong_rad: float) -> None:
        self.pose = Pose(self.pose.x_m, self.pose.y_m, self.pose.yaw_rad + wrong_rad)
        self.rolled += Pose(0.0, 0.0, wrong_rad)
        self.speeds.correct(wrong_rad)
