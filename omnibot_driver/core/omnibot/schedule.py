# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The rates at which a running board sends each kind of frame.

The period of the deltas is a setting: the manual says both 25 Hz and 10 Hz.

This module knows rates; it does not know what a frame contains.
"""

from typing import Final

from omnibot_driver.core.board import RateName

TICK_S: Final = 0.01
"""Period of the board's control loop in s; the board sends one IMU frame in each period."""
POSE_PERIOD_S: Final = 0.2
DELTA_PERIODS_S: Final = (0.01, 0.02, 0.04, 0.05, 0.1, 0.2)
"""Possible periods of the deltas in s. Each is a whole number of ticks, and divides the period of
the poses."""
DELTAS_MISSING: Final = 6
"""If this number of deltas in a row does not arrive, the board is assumed to be in IMU-only
mode."""
FEWEST_ALONE: Final = 25
"""Smallest number of IMU frames in a row, without a delta, that shows IMU-only mode.

Even with the longest period of the deltas, only 20 IMU frames come between two deltas.
"""

_IMU_BYTES_PER_S: Final = 1400
_POSE_BYTES_PER_S: Final = 75
_DELTA_BYTES: Final = 9


class Schedule:
    """The rates of the board's frames.

    ``delta_period_s``: period of the deltas in s, one of ``DELTA_PERIODS_S``.
    """

    def __init__(self, delta_period_s: float = 0.04) -> None:
        self.delta_period_s = delta_period_s
        self.imus_per_delta = round(delta_period_s / TICK_S)
        self.deltas_per_pose = round(POSE_PERIOD_S / delta_period_s)
        self.imus_alone = max(FEWEST_ALONE, DELTAS_MISSING * self.imus_per_delta + 1)
        """If this number of IMU frames arrives in a row without a delta between them, the board
        is in IMU-only mode."""
        self.bytes_per_s = _IMU_BYTES_PER_S + _DELTA_BYTES / delta_period_s + _POSE_BYTES_PER_S
        self.rates_hz: dict[RateName, float] = {
            "IMU": 1.0 / TICK_S,
            "Odometry": 1.0 / delta_period_s,
            "Pose": 1.0 / POSE_PERIOD_S,
        }


USUAL: Final = Schedule()
