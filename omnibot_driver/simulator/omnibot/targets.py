# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Set-points of the wheels (manual, Control equation), in encoder counts per control tick.

This module knows scales, signs and the kinematics. It must not know modes.
"""

from omnibot_driver.simulator.omnibot.chassis import Wheels, rims_from_body
from omnibot_driver.simulator.omnibot.motors import TICK_S
from omnibot_driver.simulator.omnibot.settings import BoardSettings
from omnibot_driver.simulator.omnibot.wire import Triple


def from_wheel_words(values: Triple, settings: BoardSettings) -> Wheels:
    """Return the set-points of the wheels for a control frame of mode 2 (v_A, v_B, v_C)."""
    a, b, c = (value / settings.linear_scale for value in values)
    return _counts_per_tick((a, b, c), settings)


def from_velocity_words(values: Triple, settings: BoardSettings) -> Wheels:
    """Return the set-points of the wheels for a control frame of mode 1 (Vx, Vy, Omega).

    The switch of the board must be on velocity.
    """
    x, y, omega = values
    linear, angular = settings.linear_scale, settings.angular_scale
    return from_twist((x / linear, y / linear, omega / angular), settings)


def from_twist(twist: tuple[float, float, float], settings: BoardSettings) -> Wheels:
    """Return the set-points of the wheels for velocities of the base in m/s and rad/s.

    ``settings.axis_signs`` is applied to the velocities.
    """
    x, y, yaw = (sign * speed for sign, speed in zip(settings.axis_signs, twist, strict=True))
    return _counts_per_tick(rims_from_body(x, y, yaw, settings.base_radius_m), settings)


def _counts_per_tick(rims_mps: Wheels, settings: BoardSettings) -> Wheels:
    a, b, c = (speed * TICK_S / settings.rim_m_per_count for speed in rims_mps)
    return a, b, c
