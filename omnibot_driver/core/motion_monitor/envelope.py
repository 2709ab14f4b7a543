# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The velocities that a robot may have under recent set-points, and how far outside one is.

A robot follows its set-points late and smoothly, so its velocity lies in the convex hull of the
recent ones and of standing still: it may always be slower. Around that hull is a margin for scales,
wheels and noise. Pure geometry, in the board's own axes; no time.
"""

import math
from collections.abc import Sequence
from typing import Final

from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.motion_monitor.set_point_history import Velocity

STRETCH: Final = 1.2
"""Part of a set-point that may be reached: scales are set by hand, controllers overshoot."""
NOISE_MPS: Final = 0.015
NOISE_RADPS: Final = 0.05
"""Encoder counts, rounding, a slope that a slow controller gives way to."""
SIDEWAYS: Final = 0.1
"""Part of a speed that may go in any direction: the heading is uncertain, wheels are not alike. Of
a yaw rate too. Independent of the noise, so the two combine by their squares."""
OVERSHOOT: Final = 0.15
"""Part of a change by which a robot goes beyond its new set-point, in any direction, when it leaves
another one that is not rest."""
SKEW_RADPS_PER_MPS: Final = 0.1
SKEW_MPS_PER_RADPS: Final = 0.03
"""Turning of a robot that drives, and the reverse, by wheels that differ by some per cent."""
CHANGING_RADPS_PER_MPS: Final = 0.4
"""The same while its speed changes, by wheels that do not speed up alike."""

YAW_MPS_PER_RADPS: Final = NOISE_MPS / NOISE_RADPS
"""What makes a yaw rate comparable to a velocity."""
_DIRECTIONS: Final = tuple(
    (math.cos(angle), math.sin(angle)) for angle in (k * math.tau / 16 for k in range(16))
)
"""Sixteen half-planes around a hull; a distance from it is underestimated by 2 % at most."""


def outside(
    motion: BodyTwist, explained: Sequence[Velocity], *, heading_known: bool
) -> tuple[float, float]:
    """Linear and angular speed outside of the envelope, m/s and rad/s; zero or less inside.

    ``explained``: of the set-points, the current one first. Where the heading is not known, only
    the length of the linear velocity counts.
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
    """Whether it lies on the way from one set-point to the next: then it is inside, for certain.

    That is so of nearly all motion, and quick to see.
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
    """The linear speed in m/s."""
    return math.hypot(twist.vx_mps, twist.vy_mps)


def dot(one: BodyTwist, other: BodyTwist) -> float:
    """The scalar product of the linear velocities, in m²/s²."""
    return one.vx_mps * other.vx_mps + one.vy_mps * other.vy_mps


def _outside_hull(motion: BodyTwist, explained: Sequence[Velocity]) -> float:
    """Distance from the hull of standing still and the stretched set-points; 0 or less inside."""
    furthest_mps = -math.inf
    for x, y in _DIRECTIONS:
        reached_mps = max([x * vx + y * vy for vx, vy, _ in explained])
        outside_mps = x * motion.vx_mps + y * motion.vy_mps - STRETCH * max(0.0, reached_mps)
        furthest_mps = max(furthest_mps, outside_mps)
    return furthest_mps
