# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The current pose and twist: a prediction from the last encoder count, with its uncertainty.

This module knows poses and speeds; it does not know commands. The caller passes the time.
"""

import math
from typing import Final

from omnibot_driver.core.geometry.se2 import Pose, roll
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.mart.doubt import SPREAD, Errors, anywhere
from omnibot_driver.core.mart.reckoning import ACCELERATION_RADPS2, BLIND_MPS, Reckoning
from omnibot_driver.core.mart.states import Motion
from omnibot_driver.core.readings import OdometryReading

LONGEST_PREDICTION_S: Final = 0.5
SLOWING_S: Final = 0.12
"""Time constant in s of the exponential decay of the robot's speed after a stop."""
ACCELERATION_MPS2: Final = 1.0
"""Standard deviation of the acceleration since the last count, in m/s²."""
FASTER_MPS, FASTER_RADPS = 0.1, 0.2
"""Amounts in m/s and rad/s by which the robot may be faster than measured. They increase the
uncertainty of the predicted pose."""
STARTS_MPS, STARTS_RADPS = 0.3, 0.6
"""Standard deviations of speed and turn rate after the start of a motion, in m/s and rad/s.
They apply until speed and turn rate are measured."""
BLIND_RADPS: Final = 1.5
"""Standard deviation of the turn rate of a robot during a controlled move, in rad/s."""
SPEED_STDDEV_MPS, SPEED_STDDEV_RADPS = 0.02, 0.03


class MartOdometry(Reckoning):
    """The odometry of one robot."""

    def told(self, now: float, *, blind_since_s: float | None) -> OdometryReading:
        """Return the odometry, predicted to ``now``.

        ``blind_since_s``: start time of a controlled move that the server executes, or may execute
        again. None without such a move, or if the server is lost.
        """
        speed_mps, rate_radps = self.speeds.means
        counted_s = self.wheel.told_s
        ahead_s = max(0.0, now - counted_s) if counted_s > -math.inf else 0.0
        predicted_s, left = min(ahead_s, LONGEST_PREDICTION_S), 1.0
        if blind_since_s is not None:
            speed_mps = rate_radps = 0.0
        elif self.slowing_since_s is not None:
            before_s = max(0.0, min(predicted_s, self.slowing_since_s - counted_s))
            slowing_s = max(0.0, now - max(self.slowing_since_s, counted_s))
            left = math.exp(-slowing_s / SLOWING_S)
            predicted_s = before_s + SLOWING_S * (1.0 - left)
        tangent = Pose(speed_mps * predicted_s, 0.0, rate_radps * predicted_s)
        twist = BodyTwist(left * speed_mps, 0.0, left * rate_radps)
        return OdometryReading(
            now,
            self.pose.moved(roll(tangent)),
            twist,
            self.doubt.total(self._unheard(ahead_s, now, blind_since_s)),
            self._speed_variances(ahead_s, blind_since_s),
            self.rolled + tangent,
            twist if blind_since_s is None else None,
        )

    def _unheard(self, ahead_s: float, now: float, blind_since_s: float | None) -> Errors:
        """Return the possible errors of the motion predicted since the last encoder count.

        ``ahead_s``: time since this count, in s. ``blind_since_s``: start time of a controlled
        move, in which the server reports no measurements; None if there is no such move.
        """
        if blind_since_s is not None:
            blind_s = max(0.0, now - blind_since_s)
            return anywhere(BLIND_MPS * blind_s, min(math.pi, BLIND_RADPS * blind_s))
        if self.motion is Motion.NONE:
            return []
        speed_mps, rate_radps = self.speeds.means
        late_s = SPREAD * self.speeds.spread_s
        if self.slowing_since_s is not None:
            late_s += min(now - self.slowing_since_s, self.speeds.spread_s)
        square_s2 = ahead_s * ahead_s / 2
        errors = anywhere(
            ACCELERATION_MPS2 * square_s2 + (abs(speed_mps) + FASTER_MPS) * late_s,
            ACCELERATION_RADPS2 * square_s2 + (abs(rate_radps) + FASTER_RADPS) * late_s,
        )
        stale_s, turn_rad = self.stale(now)
        errors += anywhere(abs(speed_mps) * stale_s * min(1.0, turn_rad), turn_rad)
        if self.on_the_spot:
            errors += self.doubt.turn(self.turn.spun_rad, self.turn.told_rad)
        if not self.speeds.are_known:
            errors += anywhere(STARTS_MPS * ahead_s, STARTS_RADPS * ahead_s)
        more_mps, more_radps = self.speeds.changes
        errors += anywhere(more_mps * ahead_s, more_radps * ahead_s)
        if self.wheel.maybe:
            errors += anywhere(*self.maybe)
        return errors

    def _speed_variances(self, ahead_s: float, blind_since_s: float | None) -> tuple[float, float]:
        if blind_since_s is not None:
            return BLIND_MPS**2, 1.0
        speed_mps, rate_radps = self.speeds.means
        part = SPREAD * self.speeds.spread_s / self.speeds.window_s
        more_mps, more_radps = (
            each * ahead_s / 2 for each in (ACCELERATION_MPS2, ACCELERATION_RADPS2)
        )
        # While the robot speeds up, the mean speeds are too low.
        lag_mps, lag_radps = self.speeds.changes
        if self.motion is Motion.NONE:
            more_mps = more_radps = lag_mps = lag_radps = 0.0
        elif not self.speeds.are_known:
            lag_mps, lag_radps = STARTS_MPS, STARTS_RADPS
        return (
            SPEED_STDDEV_MPS**2 + (speed_mps * part) ** 2 + more_mps**2 + lag_mps**2,
            SPEED_STDDEV_RADPS**2 + (rate_radps * part) ** 2 + more_radps**2 + lag_radps**2,
        )
