# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Estimates of pose, twist and covariance from the state of the motion filter.

This module knows the filter's state; it does not know which reports led to it.
"""

import math
from typing import Final

from omnibot_driver.core.geometry.differential import DifferentialKinematics
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.lois_ecu.fused_odometry import FusedOdometry, Source
from omnibot_driver.core.lois_ecu.motion_filter import MotionFilter
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.core.lois_ecu.size_errors import SizeErrors
from omnibot_driver.core.lois_ecu.wheel_motion import X, Y
from omnibot_driver.core.odometry.covariance import Covariance, OdometryNoise, Uncertainty

WHEEL_DRIFT: Final = 0.0035
"""Assumed standard deviation, in m, of the random error of a wheel's distance after 1 m."""
LATE_S: Final = 0.012
"""Assumed standard deviation of an arrival time in s, until a better value is known."""
HIDDEN_PART: Final = 1 / 6


class Estimates:
    """The estimates of one robot. Pairs of values are for the left and the right wheel.

    * ``pose``: pose of the last estimate.
    * ``heading_compared``: whether the board's odometry has corrected the heading since the last
      estimate.
    * ``late_stddev_s``: standard deviation of the timestamps.
    """

    def __init__(self, motion: MotionFilter) -> None:
        self._motion = motion
        self._uncertainty = Uncertainty(OdometryNoise())
        self._source: Source = "standing"
        self.heading_compared = False
        self.late_stddev_s = LATE_S
        self.reset()

    def configure(self, settings: LoisEcuSettings) -> None:
        """Use the new ``settings`` from the next estimate on."""
        self._settings = settings
        wheels = DifferentialKinematics(wheel_radius_m=1.0, track_m=settings.track_m)
        self._uncertainty.noise = OdometryNoise(
            wheel_drift=WHEEL_DRIFT, wheel_scale=0.0, wheel_slip=0.0, wheels=wheels
        )

    def reset(self) -> None:
        """Move the origin of the odometry frame to the robot's present pose."""
        self._uncertainty = Uncertainty(self._uncertainty.noise)
        self._sizes = SizeErrors()
        self.pose, self._ways_m = Pose(), (0.0, 0.0)

    def conclude(self, at_s: float, may_roll_mps: tuple[float, float]) -> FusedOdometry:
        """Return the estimate at ``at_s``, the time of the filter's state, and store its pose.

        The next displacement begins at the stored pose. ``may_roll_mps``: greatest possible speed
        of each wheel, in m/s.
        """
        motion = self._motion
        blind = [wheel.blind and not motion.signed for wheel in motion.wheels]
        ways_m = motion.way_m(0), motion.way_m(1)
        if not any(blind):
            self._source = "ticks" if ways_m != self._ways_m else "standing"
        elif self.heading_compared:
            self._source = "commands and heading" if all(blind) else "ticks and heading"
        elif self._source in ("standing", "ticks"):
            self._source = "commands"
        self.heading_compared = False
        fused = self.now(at_s, 0.0, may_roll_mps)
        self._uncertainty.move(self.pose.yaw_rad, self._tangent(fused.wheel_ways_m))
        self._sizes.move(*fused.wheel_ways_m, motion.turn_sign * motion.track_m)
        # An error of less than a tick is usually cancelled by the next error. After a turn the
        # two errors do not cancel, because they have different directions.
        turned = min(abs(fused.displacement.yaw_rad), 1.0)
        hidden = HIDDEN_PART * (self._settings.tick_m * turned) ** 2
        for state in (X, Y):
            motion.filter.disturb([(state, 1.0)], hidden)
        self.pose, self._ways_m = fused.pose, ways_m
        return fused

    def now(
        self, stamp_s: float, unheard_s: float, may_roll_mps: tuple[float, float]
    ) -> FusedOdometry:
        """Return the estimate at ``stamp_s``, without an effect on later estimates.

        * ``unheard_s``: time in s from the time of the filter's state to ``stamp_s``.
        * ``may_roll_mps``: greatest possible speed of each wheel in this time, in m/s.
        """
        motion = self._motion
        mean = motion.filter.mean
        pose = Pose(mean[X], mean[Y], motion.yaw_rad)
        ways_m = motion.way_m(0) - self._ways_m[0], motion.way_m(1) - self._ways_m[1]
        speeds = self._tangent((motion.speed_mps(0), motion.speed_mps(1)))
        twist = BodyTwist(speeds.x_m, 0.0, speeds.yaw_rad)
        left_mps, right_mps = may_roll_mps
        rolled_m = left_mps * unheard_s, right_mps * unheard_s
        covariance = self._covariance(pose.yaw_rad, twist, rolled_m)
        variances, displacement = motion.twist_variances(stamp_s), self.pose.way_to(pose)
        if unheard_s > 0.0:  # each wheel may now stand, or roll as fast as it can
            turning_radps = math.hypot(left_mps, right_mps) / self._settings.track_m
            variances = (
                variances[0] + ((left_mps + right_mps) / 2) ** 2,
                variances[1] + turning_radps**2,
            )
        return FusedOdometry(
            stamp_s, pose, twist, covariance, variances, displacement, ways_m, self._source
        )

    def _tangent(self, ways_m: tuple[float, float]) -> Pose:
        turn = self._motion.turn_sign * (ways_m[1] - ways_m[0]) / self._settings.track_m
        return Pose((ways_m[0] + ways_m[1]) / 2, 0.0, turn)

    def _covariance(
        self, yaw_rad: float, twist: BodyTwist, rolled_m: tuple[float, float]
    ) -> Covariance:
        filtered = self._motion.pose_covariance()
        whole = self._uncertainty.total(Pose()) + self._sizes.covariance(yaw_rad) + filtered
        left_m, right_m = rolled_m
        late_m = math.hypot(self.late_stddev_s * twist.vx_mps, (left_m + right_m) / 2)
        turned_rad = math.hypot(left_m, right_m) / self._settings.track_m
        late_rad = math.hypot(self.late_stddev_s * twist.yaw_rate_radps, turned_rad)
        along = (late_m**2, math.cos(yaw_rad), math.sin(yaw_rad), 0.0)
        return whole.with_errors([along, (late_rad**2, 0.0, 0.0, 1.0)])
