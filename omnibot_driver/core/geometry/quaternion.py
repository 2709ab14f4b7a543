# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The heading of a rotation that is given as a quaternion."""

import math


def yaw_of(x: float, y: float, z: float, w: float) -> float:
    """Yaw in rad, from -pi to pi, of a unit quaternion; its roll and pitch do not matter."""
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
