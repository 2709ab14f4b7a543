# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Converts a body twist into commands for both boards.

Until the front wheel reaches its angle, the drive board gets a lower speed or a stop.
"""

import math
from dataclasses import dataclass
from typing import Final

from omnibot_driver.core.geometry.steered import SteeredKinematics
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.values import value

ACROSS_RAD: Final = math.radians(85.0)
"""Target angle of the front wheel, in rad, from which a command is a turn on the spot."""
ALIGNED_RAD: Final = math.radians(5.0)
STILL_ALIGNED_RAD: Final = math.radians(10.0)
"""``ALIGNED_RAD``, ``STILL_ALIGNED_RAD``: largest deviation of the front wheel from its target
angle, in rad, at which a turn on the spot may begin, and may continue.
"""
GIVEN_RAD: Final = math.radians(5.0)
"""Tolerance of the body's velocity while the front wheel turns, as an angle in rad.

The tolerance in m/s is the commanded speed at the front wheel times the sine of this angle.
"""


@value(frozen=True, slots=True)
class Steered:
    """A command for both boards, and the resulting motion of the body.

    * ``speed_mps``, ``turn_radps``: speed and turn rate for the front board.
    * ``part``: factor, 0..1, by which the drive board gets a lower speed and turn rate.
    * ``angle_rad``: the angle that the front wheel must reach.
    * ``twist``: the body's motion at the front wheel's current angle.
    """

    speed_mps: float
    turn_radps: float
    part: float
    angle_rad: float
    twist: BodyTwist


@dataclass(frozen=True, slots=True)
class Geometry:
    """Geometry of the robot in m: the track B and the wheelbase F of the manual."""

    track_m: float
    wheelbase_m: float

    @property
    def kinematics(self) -> SteeredKinematics:
        """Kinematics with wheels of 1 m radius: wheel rates in rad/s equal rim speeds in m/s."""
        return SteeredKinematics(1.0, self.track_m, self.wheelbase_m)


AT_REST: Final = BodyTwist(0.0, 0.0, 0.0)


def scale(twist: BodyTwist, track_m: float) -> float:
    """Return the factor for speed and turn rate in a motion line (``rc``).

    The factor gives the drive board's outer wheel the speed that the twist requires.
    """
    # The drive board drives its outer wheel at sqrt(v² + w²), and turns about a centre that follows
    # from the measured front angle. The factor makes the root equal to the speed that the outer
    # wheel needs.
    return outer_mps(twist, track_m) / math.hypot(twist.vx_mps, twist.yaw_rate_radps)


def outer_mps(twist: BodyTwist, track_m: float) -> float:
    """Return the rim speed of the outer wheel in m/s. It is never negative."""
    return abs(twist.vx_mps) + abs(twist.yaw_rate_radps) * track_m / 2


def steer(
    wanted: BodyTwist, geometry: Geometry, angle_rad: float | None, *, turning: bool
) -> Steered:
    """Return the command for both boards that gives the body the twist ``wanted``.

    ``wanted`` is not zero.

    ``angle_rad``: the front wheel's measured angle; None while unknown.

    ``turning``: whether the body already turns on the spot.
    """
    target_rad = geometry.kinematics.steering_rad(wanted)
    factor = scale(wanted, geometry.track_m)
    outer = outer_mps(wanted, geometry.track_m)
    part, twist = 0.0, AT_REST
    if angle_rad is not None:
        allowed = min(outer, _allowed(wanted, geometry, target_rad, angle_rad, turning=turning))
        part = allowed / outer
        if allowed:
            twist = body_twist(math.copysign(allowed, wanted.vx_mps or 1.0), geometry, angle_rad)
    return Steered(factor * wanted.vx_mps, factor * wanted.yaw_rate_radps, part, target_rad, twist)


def body_twist(outer_mps: float, geometry: Geometry, angle_rad: float) -> BodyTwist:
    """Return the body's twist, computed by the manual's equations.

    ``outer_mps``: rim speed of the outer wheel; negative means backward. ``angle_rad``: angle of
    the front wheel.
    """
    across = math.sin(angle_rad) / geometry.wheelbase_m
    rolled = outer_mps / (math.cos(angle_rad) + abs(across) * geometry.track_m / 2)
    return BodyTwist(rolled * math.cos(angle_rad), 0.0, rolled * across)


def _allowed(
    wanted: BodyTwist, geometry: Geometry, target_rad: float, angle_rad: float, *, turning: bool
) -> float:
    """Return the largest allowed rim speed of the outer wheel, in m/s; infinity without a limit.

    ``angle_rad``, ``target_rad``: current and target angle of the front wheel.
    """
    off_rad = abs(angle_rad - target_rad)
    if abs(target_rad) >= ACROSS_RAD:
        near = off_rad <= (STILL_ALIGNED_RAD if turning else ALIGNED_RAD)
        return math.inf if near else 0.0
    if off_rad <= ALIGNED_RAD:
        return math.inf
    front_m = geometry.wheelbase_m
    sideways = front_m * abs(wanted.yaw_rate_radps)
    if angle_rad * target_rad < 0.0:
        sideways = 0.0
    given = math.hypot(wanted.vx_mps, front_m * wanted.yaw_rate_radps) * math.sin(GIVEN_RAD)
    cos, sin = math.cos(angle_rad), abs(math.sin(angle_rad))
    if cos <= 0.0:
        return 0.0
    rolled = (abs(wanted.vx_mps) + given) / cos
    if sin:
        rolled = min(rolled, (sideways + given) / sin)
    return rolled * (cos + sin / front_m * geometry.track_m / 2)
