# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The envelope: the velocities that a robot may have under its recent set-points.

A robot follows its set-points late and smoothly, so its velocity is in the convex hull of the
recent set-points and rest. Rest is included because a robot may always be slower than commanded. A
margin around the hull allows for inexact scales, unequal wheels and noise. The module is pure
geometry, in the board's own axes, and does not know time.
"""

import math
from collections.abc import Sequence
from typing import Final

from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.motion_monitor.set_point_history import Velocity

STRETCH: Final = 1.2
"""Largest allowed ratio of speed to set-point. It is above 1 because users measure the scales by
hand, and controllers overshoot."""
NOISE_MPS: Final = 0.015
NOISE_RADPS: Final = 0.05
"""``NOISE_MPS``, ``NOISE_RADPS``: noise in m/s and rad/s that is always allowed.

The causes are encoder counts, rounding, and a slope on which a slow controller lets the robot roll.
"""
SIDEWAYS: Final = 0.1
"""Fraction of a speed, or of a yaw rate, by which motion may deviate in any direction.

The heading is uncertain, and wheels differ. The resulting error is independent of the noise, so the
squares of both are added.
"""
OVERSHOOT: Final = 0.15
"""Fraction of a change of set-point by which a robot may overshoot, in any direction.

Overshoot is allowed only if the robot leaves a set-point other than rest.
"""
SKEW_RADPS_PER_MPS: Final = 0.1
SKEW_MPS_PER_RADPS: Final = 0.03
"""``SKEW_RADPS_PER_MPS``, ``SKEW_MPS_PER_RADPS``: yaw rate that is allowed for each m/s of
commanded speed, and speed that is allowed for each rad/s of commanded yaw rate. The reason is that
wheels differ by some per cent."""
CHANGING_RADPS_PER_MPS: Final = 0.4
"""Yaw rate that is allowed for each m/s by which the set-point changes, because wheels accelerate
differently."""

YAW_MPS_PER_RADPS: Final = NOISE_MPS / NOISE_RADPS
"""Factor that converts a yaw rate in rad/s to a speed in m/s, so that the noises of both are
equal."""
_DIRECTIONS: Final = tuple(
    (math.cos(angle), math.sin(angle)) for angle in (k * math.tau / 16 for k in range(16))
)
"""Normals of 16 half-planes around a hull. They give a distance to the hull that is at most 2 % too
small."""


def outside(
    motion: BodyTwist, explained: Sequence[Velocity], *, heading_known: bool
) -> tuple[float, float]:
    """Return by how much the motion exceeds the envelope, in m/s and rad/s; 0 or less if inside.

    ``explained``: velocities that recent set-points can cause, the current set-point's first. If
    the heading is unknown, only the magnitude of the linear velocity is checked.
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
    """Return whether ``motion`` lies between two successive set-points, and so in the envelope.

    This check is quick, and true for nearly all motion.
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
    """Return how far a velocity is outside the hull of rest and the stretched set-points.

    The result is in m/s, and 0 or less inside the hull. Set-points are stretched by ``STRETCH``.
    """
    furthest_mps = -math.inf
    for x, y in _DIRECTIONS:
        reached_mps = max([x * vx + y * vy for vx, vy, _ in explained])
        outside_mps = x * motion.vx_mps + y * motion.vy_mps - STRETCH * max(0.0, reached_mps)
        furthest_mps = max(furthest_mps, outside_mps)
    return furthest_mps
