# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The envelope: the velocities that a robot may have under its recent set-points.

It is the convex hull of the recent set-points and the velocity zero, with a margin.
docs/internals/motion_monitor.md gives the reasons.

This module knows velocities in the board's own axes; it does not know times.
"""

import math
from collections.abc import Sequence
from typing import Final

from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.motion_monitor.set_point_history import Velocity

STRETCH: Final = 1.2
"""Largest allowed ratio of speed to set-point.

The ratio is above 1, because controllers overshoot, and users measure the board's scales by hand.
"""
NOISE_MPS: Final = 0.015
NOISE_RADPS: Final = 0.05
"""``NOISE_MPS``, ``NOISE_RADPS``: always allowed deviation from the set-points, in m/s and rad/s.

The encoders' resolution, rounding and slopes can cause such a deviation.
"""
SIDEWAYS: Final = 0.1
"""Deviation from the set-points that is allowed in any direction.

It is a fraction of the commanded speed or yaw rate. This deviation and the noise are independent,
so their squares are added.
"""
OVERSHOOT: Final = 0.15
"""Overshoot allowed in any direction, as a fraction of the change of the set-point.

No overshoot is allowed if the earlier set-point was zero.
"""
SKEW_RADPS_PER_MPS: Final = 0.1
SKEW_MPS_PER_RADPS: Final = 0.03
"""``SKEW_RADPS_PER_MPS``: yaw rate in rad/s that is allowed for each commanded m/s.

``SKEW_MPS_PER_RADPS``: speed in m/s that is allowed for each commanded rad/s.

Such motion is allowed, because the robot's wheels differ by some per cent.
"""
CHANGING_RADPS_PER_MPS: Final = 0.4
"""Yaw rate in rad/s that is allowed for each m/s by which the set-point changes.

The robot may turn during such a change, because its wheels accelerate differently.
"""

YAW_MPS_PER_RADPS: Final = NOISE_MPS / NOISE_RADPS
"""Factor that converts a yaw rate in rad/s to a speed in m/s.

It is the ratio of the two noise limits, ``NOISE_MPS`` and ``NOISE_RADPS``.
"""
_DIRECTIONS: Final = tuple(
    (math.cos(angle), math.sin(angle)) for angle in (k * math.tau / 16 for k in range(16))
)
"""Directions in which the distance of a velocity from the hull of allowed velocities is computed.

Between two directions, the computed distance is too small: by at most 2 % of the distance, plus
10 % of the hull's length.
"""


def outside(
    motion: BodyTwist, explained: Sequence[Velocity], *, heading_known: bool
) -> tuple[float, float]:
    """Return how far the motion is outside the envelope, in m/s and rad/s; inside, 0 or less.

    ``explained``: the allowed velocities, that of the current set-point first. ``heading_known``:
    if False, the linear velocity's direction is not checked.
    """
    current_x, current_y, _ = explained[0]
    fastest = change = leaving = left = right = 0.0
    for x, y, yaw in explained:
        fastest = max(fastest, math.hypot(x, y))
        change = max(change, math.hypot(x - current_x, y - current_y))
        if x or y:
            leaving = max(leaving, math.hypot(x - current_x, y - current_y))
        if yaw > left:
            left = yaw
        elif -yaw > right:
            right = -yaw
    way_mps, rate = speed_of(motion) - STRETCH * fastest, motion.yaw_rate_radps
    if heading_known and fastest:
        way_mps = _outside_hull(motion, explained)
    turn_radps, fastest_turn = max(rate - STRETCH * left, -rate - STRETCH * right), max(left, right)
    way_mps -= max(math.hypot(NOISE_MPS, SIDEWAYS * fastest), NOISE_MPS + OVERSHOOT * leaving)
    way_mps -= SKEW_MPS_PER_RADPS * fastest_turn
    turn_radps -= math.hypot(NOISE_RADPS, SIDEWAYS * fastest_turn)
    turn_radps -= SKEW_RADPS_PER_MPS * fastest + CHANGING_RADPS_PER_MPS * change
    return way_mps, turn_radps


def on_the_way(motion: BodyTwist, setpoints: Sequence[BodyTwist]) -> bool:
    """Return whether the motion is near a set-point, or near the line from one to the next one.

    Such motion is inside the envelope. The caller makes this quick check before the exact one,
    ``outside``.
    """
    x, y, yaw = motion.vx_mps, motion.vy_mps, YAW_MPS_PER_RADPS * motion.yaw_rate_radps
    last = setpoints[0]
    for each in setpoints:
        to_x, to_y = x - each.vx_mps, y - each.vy_mps
        to_yaw = yaw - YAW_MPS_PER_RADPS * each.yaw_rate_radps
        way_x, way_y = last.vx_mps - each.vx_mps, last.vy_mps - each.vy_mps
        way_yaw = YAW_MPS_PER_RADPS * (last.yaw_rate_radps - each.yaw_rate_radps)
        square = way_x * way_x + way_y * way_y + way_yaw * way_yaw
        along = to_x * way_x + to_y * way_y + to_yaw * way_yaw
        part = 0.0 if along <= 0.0 else 1.0 if along >= square else along / square
        off_x, off_y, off_yaw = to_x - part * way_x, to_y - part * way_y, to_yaw - part * way_yaw
        if off_x * off_x + off_y * off_y + off_yaw * off_yaw < NOISE_MPS * NOISE_MPS:
            return True
        last = each
    return False


def speed_of(twist: BodyTwist) -> float:
    """Return the linear speed in m/s."""
    return math.hypot(twist.vx_mps, twist.vy_mps)


def dot(one: BodyTwist, other: BodyTwist) -> float:
    """Return the scalar product of the linear velocities, in m²/s²."""
    return one.vx_mps * other.vx_mps + one.vy_mps * other.vy_mps


def _outside_hull(motion: BodyTwist, explained: Sequence[Velocity]) -> float:
    """Return how far a velocity is outside the hull, in m/s; 0 or less if it is inside.

    The hull is the convex hull of zero speed and of all velocities in ``explained``, multiplied by
    1.2 (``STRETCH``).
    """
    furthest_mps = -math.inf
    for x, y in _DIRECTIONS:
        reached_mps = max([x * vx + y * vy for vx, vy, _ in explained])
        outside_mps = x * motion.vx_mps + y * motion.vy_mps - STRETCH * max(0.0, reached_mps)
        furthest_mps = max(furthest_mps, outside_mps)
    return furthest_mps
