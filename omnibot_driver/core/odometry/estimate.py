# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The result of the odometry, and the settings that it depends on.

All boards have these in common. How the result is computed is in other modules.
"""

from dataclasses import dataclass, field

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.odometry.covariance import Covariance, OdometryNoise
from omnibot_driver.core.values import value


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometrySettings:
    """The settings of the odometry.

    * ``use_board_pose``: if False, the board's poses do not correct the odometry. They only give
      the heading, at the beginning and after a reset that follows a gap.
    * ``fastest_mps``, ``fastest_radps``: speeds that even a pushed robot does not exceed.
    * ``linear_scale``, ``angular_scale``: true distance and turn, divided by the reported ones.
    """

    noise: OdometryNoise = field(default_factory=OdometryNoise)
    use_board_pose: bool = True
    fastest_mps: float = 2.0
    fastest_radps: float = 8.0
    linear_scale: float = 1.0
    angular_scale: float = 1.0


@value(frozen=True, slots=True)
class OdometryEstimate:
    """The odometry at ``stamp_s``: pose and covariance in the odometry frame, twist in body axes.

    * ``twist``: None if the duration of the displacement is unknown.
    * ``rolled``: sum of all motion so far (twist x time), in the board's axes; it gives the wheel
      angles.
    * ``rolling``: present rate of change of ``rolled``, a twist in the board's axes; None if
      unknown.
    * ``twist_variances``: linear in m²/s², angular in rad²/s². If None, the values of the
      parameters are published.
    """

    stamp_s: float
    pose: Pose
    twist: BodyTwist | None
    covariance: Covariance
    rolled: Pose = field(default_factory=Pose)
    rolling: BodyTwist | None = None
    twist_variances: tuple[float, float] | None = None
