# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Robots under way on a line that loses frames, and when their odometry is settled again."""

from itertools import pairwise

from lossy_odometry import Line, loses_nothing

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.odometry.estimator import Odometry, OdometryEstimate, OdometrySettings
from omnibot_driver.core.readings import PoseReading
from omnibot_driver.simulator.omnibot import BoardPose, BoardSettings

PERIOD_S = 0.04
ROUNDING_M = 1.5e-3
ROUNDING_RAD = 1.5e-3
"""Of the deltas since the last pose."""
DRIVEN = BoardPose(3000.0, -2000.0, 700.0)


def line(seed: int, settings_: OdometrySettings | None = None, frame: str = "earth") -> Line:
    """Two seconds under way, on a board that has driven before."""
    board = BoardSettings(seed=seed, frame=frame, running=True, initial_pose=DRIVEN)
    found = Line(board, settings_, seed=seed)
    found.run(2.0 + seed % 5 * PERIOD_S)
    return found


def lose(on: Line, seconds: float, *headers: bytes) -> None:
    """Lose all bytes, or frames that begin like this, for a while."""
    on.loses = lambda data, _now: not headers or data[:2] in headers
    on.run(seconds)
    on.loses = loses_nothing


def settled(on: Line) -> bool:
    off = on.error
    return off.way_m < ROUNDING_M and abs(off.yaw_rad) < ROUNDING_RAD


def steps(estimates: list[OdometryEstimate]) -> list[tuple[float, Pose]]:
    """Time from one to the next, and what the pose did in it."""
    return [
        (after.stamp_s - before.stamp_s, after.pose - before.pose)
        for before, after in pairwise(estimates)
    ]


def attached(settings_: OdometrySettings | None = None) -> Odometry:
    """A board that stands at zero and has said so twice."""
    odometry = Odometry(settings_ or OdometrySettings())
    odometry.settle(PoseReading(0.0, 0.0, 0.0))
    odometry.settle(PoseReading(0.0, 0.0, 0.0))
    return odometry
