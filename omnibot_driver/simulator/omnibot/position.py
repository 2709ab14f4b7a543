# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Positional control: driving to a commanded pose.

The manual describes only the switch that selects this control; everything else is assumed. This
module must not know wheels.
"""

from math import cos, hypot, sin

from omnibot_driver.simulator.omnibot.chassis import PlanarPose
from omnibot_driver.simulator.omnibot.settings import BoardSettings
from omnibot_driver.simulator.omnibot.wire import Triple

SPEED_PER_WAY = 2.0
"""Speed divided by the distance from the goal, in 1/s. The speed is limited to ``FASTEST_MPS`` and
``FASTEST_RADPS``."""
FASTEST_MPS = 0.3
FASTEST_RADPS = 1.0
ARRIVED = 0.5e-3
"""Largest deviation from the goal, in m or rad, at which the robot no longer drives or turns."""


def commanded_pose(values: Triple, settings: BoardSettings) -> PlanarPose:
    """Return the pose that is commanded by a control frame, in the board's earth frame."""
    x, y, theta = values
    return PlanarPose(
        x / settings.position_scale, y / settings.position_scale, theta / settings.heading_scale
    )


def approach(pose: PlanarPose, goal: PlanarPose) -> tuple[float, float, float]:
    """Return the twist straight to the goal: body x and y in m/s, and the yaw rate in rad/s.

    Headings are unwrapped: a difference of 2π is a full turn.
    """
    dx_m, dy_m = goal.x_m - pose.x_m, goal.y_m - pose.y_m
    way_m, turn_rad = hypot(dx_m, dy_m), goal.yaw_rad - pose.yaw_rad
    per_m = min(SPEED_PER_WAY, FASTEST_MPS / way_m) if way_m > ARRIVED else 0.0
    yaw_rate = max(-FASTEST_RADPS, min(FASTEST_RADPS, SPEED_PER_WAY * turn_rad))
    c, s = cos(pose.yaw_rad), sin(pose.yaw_rad)
    return (
        per_m * (c * dx_m + s * dy_m),
        per_m * (c * dy_m - s * dx_m),
        yaw_rate if abs(turn_rad) > ARRIVED else 0.0,
    )
