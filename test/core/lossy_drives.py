# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Drives on a line that loses frames, for tests of the odometry."""

from itertools import pairwise

from lossy_odometry import Line, loses_nothing

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.odometry.estimate import OdometryEstimate, OdometrySettings
from omnibot_driver.core.odometry.estimator import Odometry
from omnibot_driver.core.readings import PoseReading
from omnibot_driver.simulator.omnibot import BoardPose, BoardSettings

PERIOD_S = 0.04
ROUNDING_M = 1.5e-3
ROUNDING_RAD = 1.5e-3
"""``ROUNDING_M``, ``ROUNDING_RAD``: limits for the odometry's rounding error, in m and in rad.

The error from rounded deltas grows until the next pose of the board. A larger error fails the test.
"""
DRIVEN = BoardPose(3000.0, -2000.0, 700.0)


def line(seed: int, settings_: OdometrySettings | None = None, frame: str = "earth") -> Line:
    """Return a ``Line`` after about 2 s of driving, with a board whose first pose was not zero."""
    board = BoardSettings(seed=seed, frame=frame, running=True, initial_pose=DRIVEN)
    found = Line(board, settings_, seed=seed)
    found.run(2.0 + seed % 5 * PERIOD_S)
    return found


def lose(on: Line, seconds: float, *headers: bytes) -> None:
    """Lose all frames with these headers for ``seconds``. Without headers, lose every frame."""
    on.loses = lambda data, _now: not headers or data[:2] in headers
    on.run(seconds)
    on.loses = loses_nothing


def settled(on: Line) -> bool:
    off = on.error
    return off.way_m < ROUNDING_M and abs(off.yaw_rad) < ROUNDING_RAD


def steps(estimates: list[OdometryEstimate]) -> list[tuple[float, Pose]]:
    """Return the time in s and the motion from each estimate to the next one."""
    return [
        (after.stamp_s - before.stamp_s, after.pose - before.pose)
        for before, after in pairwise(estimates)
    ]


def attached(settings_: OdometrySettings | None = None) -> Odometry:
    """Return odometry that has received the board's pose (0, 0, 0) twice and has accepted it."""
    odometry = Odometry(settings_ or OdometrySettings())
    odometry.settle(PoseReading(0.0, 0.0, 0.0))
    odometry.settle(PoseReading(0.0, 0.0, 0.0))
    return odometry
