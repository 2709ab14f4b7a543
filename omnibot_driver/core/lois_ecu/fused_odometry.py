# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The estimate of a LOIS ECU's motion as it is passed on; values only."""

from dataclasses import dataclass
from typing import Literal

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.odometry.covariance import Covariance

Source = Literal["standing", "ticks", "ticks and heading", "commands and heading", "commands"]
"""What the last interval is known by."""


@dataclass(frozen=True, slots=True)
class FusedOdometry:
    """The odometry at ``stamp_s``: pose and covariance in its frame, twist in the body's.

    ``displacement``: since the estimate before, in the robot's own axes. ``wheel_ways_m``: of
    nominal wheels, the board's left and right, since then. ``predicted``: nothing was heard of this
    time yet. ``blind``: the board told nothing of some of the motion.
    """

    stamp_s: float
    pose: Pose
    twist: BodyTwist
    covariance: Covariance
    twist_covariance: tuple[float, float]
    displacement: Pose
    wheel_ways_m: tuple[float, float]
    source: Source
    predicted: bool = False

    @property
    def blind(self) -> bool:
        """Whether the motion is known by commands and not by measurement."""
        return self.source in ("commands", "commands and heading")
