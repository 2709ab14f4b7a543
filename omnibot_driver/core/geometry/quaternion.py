# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Heading of a rotation that is given as a quaternion."""

import math


def yaw_of(x: float, y: float, z: float, w: float) -> float:
    """Return the yaw of a unit quaternion in rad, -pi to pi. Roll and pitch may have any value."""
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
