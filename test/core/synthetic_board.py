# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A synthetic board for odometry tests. It moves with given body twists and returns readings.

It shares no code with the driver, so that it can show errors in the driver's code.
"""

import math

import pytest

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.odometry.estimate import OdometryEstimate, OdometrySettings
from omnibot_driver.core.odometry.estimator import Odometry
from omnibot_driver.core.readings import DisplacementReading, PoseReading

PERIOD_S = 0.04
SETTINGS = OdometrySettings()
Triple = tuple[float, float, float]


def xyyaw(pose: Pose) -> Triple:
    return pose.x_m, pose.y_m, pose.yaw_rad


def close(values: Triple, tolerance: float = 1e-9) -> object:
    return pytest.approx(values, abs=tolerance, rel=1e-9)


def arc(vx: float, vy: float, turn: float) -> tuple[float, float]:
    """Return the displacement in x and y during a motion with a constant twist.

    It is the integral of the rotation matrix. ``vx``, ``vy`` and ``turn`` are velocity times
    duration.
    """
    if abs(turn) < 1e-6:
        return vx - vy * turn / 2, vy + vx * turn / 2
    a, b = math.sin(turn) / turn, (1 - math.cos(turn)) / turn
    return a * vx - b * vy, b * vx + a * vy


class Trip:
    """A drive of a robot: the true pose of the robot, and the readings of its board.

    ``heading``: the board's initial heading in rad. ``signs``: -1 for each axis that the board
    reverses.
    """

    def __init__(self, heading: float = 0.0, signs: tuple[int, int, int] = (1, 1, 1)) -> None:
        self.board = (12.0, -34.0, heading)
        self.truth = (0.0, 0.0, 0.0)
        self._signs = signs

    def move(self, dx: float, dy: float, turn: float, frame: str = "earth") -> DisplacementReading:
        """Move with a constant twist for one period ``PERIOD_S``, and return the board's reading.

        ``dx``, ``dy``, ``turn``: twist times duration, in the robot's true body axes.
        """
        self.truth = self._moved(self.truth, dx, dy, turn)
        x, y, yaw = self._signs
        before = self.board
        self.board = self._moved(before, x * dx, y * dy, yaw * turn)
        if frame == "body":
            return DisplacementReading(x * dx, y * dy, yaw * turn, "body", PERIOD_S, 0)
        return DisplacementReading(
            self.board[0] - before[0], self.board[1] - before[1], yaw * turn, "earth", PERIOD_S, 0
        )

    @property
    def pose(self) -> PoseReading:
        """The board's own pose."""
        return PoseReading(*self.board)

    @staticmethod
    def _moved(pose: Triple, dx: float, dy: float, turn: float) -> Triple:
        x, y, yaw = pose
        ahead, left = arc(dx, dy, turn)
        c, s = math.cos(yaw), math.sin(yaw)
        return x + c * ahead - s * left, y + s * ahead + c * left, yaw + turn


def earth(dx: float, dy: float, turn: float = 0.0) -> DisplacementReading:
    return DisplacementReading(dx, dy, turn, "earth", PERIOD_S, 0)


def body(dx: float, dy: float, turn: float = 0.0) -> DisplacementReading:
    return DisplacementReading(dx, dy, turn, "body", PERIOD_S, 0)


def heading(yaw: float) -> PoseReading:
    return PoseReading(1.0, 2.0, yaw)


def attach(odometry: Odometry, pose: PoseReading) -> list[OdometryEstimate]:
    """Deliver a pose of the board twice; return the odometry estimates of the second delivery.

    The odometry accepts a pose only when it is confirmed.
    """
    assert odometry.settle(pose) == []
    return odometry.settle(pose)


def last(estimates: list[OdometryEstimate]) -> Triple:
    return xyyaw(estimates[-1].pose)
