# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Odometry estimates of a robot with a LOIS ECU: values only."""

from dataclasses import dataclass
from typing import Literal

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.odometry.covariance import Covariance

Source = Literal["standing", "ticks", "ticks and heading", "commands and heading", "commands"]
"""Data from which the motion since the last estimate was computed.

"standing": the robot is at rest. "heading": the heading in the board's odometry, not from the
compass.
"""


@dataclass(frozen=True, slots=True)
class FusedOdometry:
    """Estimated odometry of the robot at the time ``stamp_s``.

    * ``pose``, ``covariance``: in the odometry frame.
    * ``twist``: in the body frame.
    * ``twist_covariance``: variances in (m/s)² and (rad/s)².
    * ``displacement``: motion since the previous estimate, in the robot's axes at that time.
    * ``wheel_ways_m``: distances of the board's left and right wheel since the previous estimate.
    """

    stamp_s: float
    pose: Pose
    twist: BodyTwist
    covariance: Covariance
    twist_covariance: tuple[float, float]
    displacement: Pose
    wheel_ways_m: tuple[float, float]
    source: Source

    @property
    def blind(self) -> bool:
        """Whether the motion was computed from the commands, because no ticks were counted."""
        return self.source in ("commands", "commands and heading")
