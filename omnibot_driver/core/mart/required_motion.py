# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The motion that a command requires, and its twist.

This module knows commands and the track width; it does not know the server. The caller passes the
time.
"""

import math
from typing import Final

from omnibot_driver.core.commands.actuator import Wanted
from omnibot_driver.core.commands.orders import Drive, EmergencyStop, GoTo, Stop
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.mart.states import Motion

STANDING: Final = BodyTwist(0.0, 0.0, 0.0)
SLOWEST_MPS, SLOWEST_RADPS = 0.02, 0.03
"""Limits of speed (m/s) and yaw rate (rad/s). A command below both is regarded as a standstill."""
RAMP_LEFT: Final = 0.2
"""Largest difference between commanded and final yaw rate with which a turn on the spot begins, as
a fraction of the final rate. The server cannot change a turn's rate, so the driver waits for the
ramp."""


def is_standstill(wanted: Wanted) -> bool:
    """Return whether the command requires no motion."""
    return wanted is None or isinstance(wanted, Stop | EmergencyStop) or wanted.is_zero


def is_turn_ramped(wanted: Wanted, now: float) -> bool:
    """Return whether a ramp still keeps the commanded yaw rate far from its final value.

    Far means a difference of more than RAMP_LEFT times the final value.
    """
    if wanted is None or isinstance(wanted, Stop | EmergencyStop):
        return False
    present, final = wanted.order(now), wanted.final
    if not (isinstance(present, Drive) and isinstance(final, Drive)):
        return False
    final_radps = final.twist.yaw_rate_radps
    return abs(present.twist.yaw_rate_radps - final_radps) > RAMP_LEFT * abs(final_radps)


def moving_order(wanted: Wanted, now: float) -> Drive | GoTo | None:
    """Return the order that the command gives at this time, or None if it requires no motion."""
    if wanted is None or isinstance(wanted, Stop | EmergencyStop) or wanted.is_zero:
        return None
    order = wanted.order(now)
    return order if isinstance(order, Drive | GoTo) else None


def required_motion(order: Drive | GoTo | None, track_m: float) -> tuple[Motion, BodyTwist]:
    """Return the motion that the order requires, and its twist.

    The motion is Motion.NONE for a goal (GoTo), and for a standstill.
    """
    if not isinstance(order, Drive):
        return Motion.NONE, STANDING
    speed, rate = order.twist.vx_mps, order.twist.yaw_rate_radps
    if abs(speed) < SLOWEST_MPS and abs(rate) < SLOWEST_RADPS:
        return Motion.NONE, STANDING
    if _is_on_the_spot(speed, rate, track_m):
        return Motion.SPIN, BodyTwist(0.0, 0.0, rate)
    motion = Motion.REFERENCE if speed > 0.0 else Motion.REVERSE
    return motion, BodyTwist(speed, 0.0, rate)


def _is_on_the_spot(speed_mps: float, rate_radps: float, track_m: float) -> bool:
    """Return whether the twist is nearer to a turn on the spot than to a turn about one wheel."""
    return abs(speed_mps) < 0.5 * abs(rate_radps) * track_m / 2 or math.isclose(speed_mps, 0.0)
