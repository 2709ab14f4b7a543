# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Where the robot is, by the way of its right wheel and the relative heading, polled.

The count begins anew with each motion. The heading is told while RM drives; of a turn on the spot
the wheel tells it until the reply to SM does; of a controlled move nothing is known before its end.
Knows counts, degrees and metres; no words. Time is an argument.
"""

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import replace
from typing import Final

from omnibot_driver.core.geometry.se2 import Pose, roll
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.mart.settings import MartSettings
from omnibot_driver.core.mart.states import Motion
from omnibot_driver.core.odometry.covariance import Covariance
from omnibot_driver.core.readings import DisplacementReading, OdometryReading

WINDOW_S: Final = 0.35
"""Speeds are those of this time."""
LONGEST_PREDICTION_S: Final = 0.5
SLOWING_S: Final = 0.12
"""Time constant of a robot that is being stopped."""
ACCELERATION_MPS2, ACCELERATION_RADPS2 = 1.0, 3.0
"""Of a robot that is not heard."""
DOUBT_M, DOUBT_MPS, DOUBT_RAD = 0.03, 0.3, 0.1
"""A late count of this motion does no harm, since the next one makes it good."""
LEAST_S: Final = 0.05
MOST_M, MOST_MPS = 0.3, 2.0
"""No wheel goes farther between two counts: one of them is false."""
WAY_STDDEV: Final = 0.004
"""m after 1 m, growing with its root."""
WHEEL_HEADING: Final = 0.06
"""Relative error of a turn that the right wheel alone tells."""
TOLD_RAD, TOLD_PART = 0.05, 0.3
"""A relative heading that is so near to what the wheel tells is that of this turn."""
STRAIGHT_STDDEV_RAD: Final = math.radians(1.5)
UNEQUAL: Final = 0.04
"""Of two motors, where nothing but what is commanded tells of a turn."""
BLIND_MPS: Final = 0.3
"""A robot in a controlled move of which nothing is heard is anywhere within this speed."""
SPEED_VARIANCES: Final = (0.02**2, 0.03**2)


class MartOdometry:
    """``pose``: at the last count. ``counted_s``: when that was. ``stands``: it was stopped."""

    def __init__(self, settings: MartSettings) -> None:
        self.settings = settings
        self.rolled = Pose()
        self.reset()
        self.connect()

    def reset(self) -> None:
        """The frame begins here."""
        self.pose = Pose()
        self._walk = Covariance()
        self._levers = [(0.0, 0.0, 0.0)] * 3

    def connect(self) -> None:
        """Nothing was counted."""
        self.motion, self.stands = Motion.NONE, True
        self.counted_s = self._heading_s = -math.inf
        self._count: int | None = None
        self._zeroed = self._begins = False
        self._heading_rad: float | None = None
        self._rate_radps = 0.0
        self._turned_rad = self._turned_by_now_rad = 0.0
        self.heading_changed_s = -math.inf
        self.left_over_right: float | None = None
        """Of the wheels' speeds, where no heading is told and the commanded ones have to do."""
        self._track: deque[tuple[float, float, float]] = deque(maxlen=40)
        self._way_m = self._yaw_rad = 0.0
        self.spun_rad = self.moved_m = 0.0
        self._spin_is_told = False

    @property
    def count(self) -> int | None:
        """The last one; None where the next one may begin anew."""
        return None if self._zeroed else self._count

    @property
    def heading_s(self) -> float:
        """When the relative heading was told last."""
        return self._heading_s

    def zeroed(self) -> None:
        """The count may begin anew, by the check of the IMU."""
        self._zeroed = True

    def rest(self) -> None:
        """The motion is over."""
        if self.motion is not Motion.NONE:
            self.motion = Motion.NONE
            self.forget_speeds()

    def begin(self, motion: Motion, now: float) -> None:
        """A motion has begun, and the count with it."""
        self.motion, self.stands = motion, False
        self.left_over_right = None
        self._count, self._zeroed, self._begins = 0, True, True
        if motion is Motion.REFERENCE:
            self._heading_rad = None
        self._turned_rad = self._turned_by_now_rad = 0.0
        self.heading_changed_s = now
        self.spun_rad = self.moved_m = 0.0
        self._spin_is_told = False

    def turned(self, degrees: float, at_s: float, *, doubtful: bool) -> None:
        """The relative angle."""
        angle_rad = math.radians(degrees) * self.settings.heading_sign
        before_rad, before_s = self._heading_rad, self._heading_s
        if before_rad is None or at_s <= before_s:
            self._heading_rad, self._heading_s, self._rate_radps = angle_rad, at_s, 0.0
            return
        turn_rad, seconds = angle_rad - before_rad, at_s - before_s
        expected_rad = self._rate_radps * seconds
        most_rad = DOUBT_RAD + ACCELERATION_RADPS2 * seconds * seconds / 2
        if doubtful and abs(turn_rad - expected_rad) > most_rad:
            return
        if turn_rad:
            self.heading_changed_s = at_s
        self._turned_rad += turn_rad
        self._rate_radps = turn_rad / seconds
        self._heading_rad, self._heading_s = angle_rad, at_s

    def counted(self, count: int, at_s: float, *, doubtful: bool) -> DisplacementReading | None:
        """The right wheel's count; None for one that cannot be believed."""
        settings = self.settings
        before, before_s = self._count, self.counted_s
        if before is None or before_s == -math.inf:
            self._count, self.counted_s = count, at_s
            return DisplacementReading(0.0, 0.0, 0.0, "body", None, 0, measured=False)
        seconds = max(at_s - before_s, 1e-4)
        if self._zeroed and abs(count) <= abs(count - before):
            before = 0
        wheel_m = (count - before) * settings.metres_per_count
        if abs(wheel_m) > MOST_M + MOST_MPS * seconds:
            self._count, self.counted_s, self._zeroed = count, at_s, False
            return DisplacementReading(0.0, 0.0, 0.0, "body", None, 0, measured=False)
        speed_mps, rate_radps = self.speeds
        wheel_mps = speed_mps + rate_radps * settings.track_m / 2
        most_m = DOUBT_M + DOUBT_MPS * seconds
        if doubtful and not self._begins and abs(wheel_m - wheel_mps * seconds) > most_m:
            return None
        self._begins = False
        self._count, self.counted_s, self._zeroed = count, at_s, False
        turn_rad = self._turn_rad(wheel_m, at_s)
        way_m = 0.0 if self._on_the_spot else wheel_m - turn_rad * settings.track_m / 2
        self._move(way_m, turn_rad, seconds)
        return DisplacementReading(way_m, 0.0, turn_rad, "body", max(seconds, LEAST_S), 0)

    @property
    def _on_the_spot(self) -> bool:
        return self.motion in (Motion.SPIN, Motion.TURN)

    def _turn_rad(self, wheel_m: float, at_s: float) -> float:
        """Since the last count."""
        ahead_s = 0.0 if self.stands else min(max(0.0, at_s - self._heading_s), 0.2)
        turned_rad = self._turned_rad + self._rate_radps * ahead_s
        before_rad, self._turned_by_now_rad = self._turned_by_now_rad, turned_rad
        told_rad = turned_rad - before_rad
        if self.motion is Motion.NONE and not wheel_m:
            return 0.0  # some servers let the heading drift while the robot stands
        if self._on_the_spot:
            if self._spin_is_told:
                return 0.0  # how it rolled out is in what was told
            ratio = -1.0 if self.left_over_right is None else self.left_over_right
            turn_rad = wheel_m * (1.0 - ratio) / self.settings.track_m
            told = abs(told_rad - turn_rad) < TOLD_RAD + TOLD_PART * abs(turn_rad)
            if self.motion is Motion.TURN and told:
                turn_rad = told_rad
            self.spun_rad += turn_rad
            return turn_rad
        if self.left_over_right is not None:
            return wheel_m * (1.0 - self.left_over_right) / self.settings.track_m
        return told_rad

    def spin_told(self, degrees: float) -> None:
        """What the server has measured of a turn on the spot that is over, in the board's sign."""
        told_rad = math.radians(degrees) * self.settings.heading_sign
        wrong_rad = told_rad - self.spun_rad
        self.pose = Pose(self.pose.x_m, self.pose.y_m, self.pose.yaw_rad + wrong_rad)
        self.rolled += Pose(0.0, 0.0, wrong_rad)
        self._yaw_rad += wrong_rad
        surplus = (WHEEL_HEADING * abs(self.spun_rad)) ** 2 - math.radians(0.5) ** 2
        yaw_yaw = max(1e-6, self._walk.yaw_yaw - max(0.0, surplus))
        self._walk = replace(self._walk, yaw_yaw=yaw_yaw)
        self.spun_rad = told_rad
        self._spin_is_told = True

    def finish_straight(self) -> None:
        """A straight controlled move is over: its heading was held, as far as the server can."""
        self._add_yaw_variance(STRAIGHT_STDDEV_RAD**2)

    def _move(self, way_m: float, turn_rad: float, seconds: float) -> None:
        tangent = Pose(way_m, 0.0, turn_rad)
        before = self.pose
        self.pose = before.moved(roll(tangent))
        self.rolled += tangent
        self._way_m += way_m
        self._yaw_rad += turn_rad
        self.moved_m += way_m
        self._track.append((self.counted_s, self._way_m, self._yaw_rad))
        self._grow(before.yaw_rad, way_m, turn_rad, seconds)

    def _grow(self, heading_rad: float, way_m: float, turn_rad: float, seconds: float) -> None:
        middle_rad = heading_rad + turn_rad / 2
        cos, sin = math.cos(middle_rad), math.sin(middle_rad)
        dx_m, dy_m = way_m * cos, way_m * sin
        yaw_variance = 0.0
        drift_rad = 0.0
        if self._on_the_spot:
            yaw_variance = (WHEEL_HEADING * turn_rad) ** 2 + 2 * abs(turn_rad) * 1e-4
        elif way_m or turn_rad:
            drift_rad = seconds
        errors = [(WAY_STDDEV**2 * abs(way_m), cos, sin, 0.0), (yaw_variance, 0.0, 0.0, 1.0)]
        self._walk = self._walk.carried(dx_m, dy_m).with_errors(errors)
        guessed = self.motion is Motion.REVERSE and self.left_over_right is not None
        bend_rad = way_m / self.settings.track_m if guessed else 0.0
        own = ((dx_m, dy_m, 0.0), (0.0, 0.0, drift_rad), (0.0, 0.0, bend_rad))
        self._levers = [
            (x - dy_m * yaw + own_x, y + dx_m * yaw + own_y, yaw + own_yaw)
            for (x, y, yaw), (own_x, own_y, own_yaw) in zip(self._levers, own, strict=True)
        ]

    def _add_yaw_variance(self, rad2: float) -> None:
        self._walk = self._walk.with_errors([(rad2, 0.0, 0.0, 1.0)])

    @property
    def speeds(self) -> tuple[float, float]:
        """m/s and rad/s over the last ``WINDOW_S``, and over two counts at least; else zero."""
        if len(self._track) < 2:
            return 0.0, 0.0
        newest_s, way_m, yaw_rad = self._track[-1]
        from_s = min(newest_s - WINDOW_S, self._track[-2][0])
        at_s, then_m, then_rad = next(each for each in self._track if each[0] >= from_s)
        seconds = max(newest_s - at_s, 1e-3)
        return (way_m - then_m) / seconds, (yaw_rad - then_rad) / seconds

    def forget_speeds(self) -> None:
        """What is counted next is another motion."""
        self._track.clear()

    def told(
        self, now: float, *, blind_since_s: float | None, slowing_since_s: float | None
    ) -> OdometryReading:
        """Predicted to ``now``. ``blind_since_s``: since when a controlled move is under way;
        ``slowing_since_s``: since when the robot is being stopped.
        """
        speed_mps, rate_radps = self.speeds
        ahead_s = max(0.0, now - self.counted_s) if self.counted_s > -math.inf else 0.0
        predicted_s, left = min(ahead_s, LONGEST_PREDICTION_S), 1.0
        if blind_since_s is not None:
            speed_mps = rate_radps = 0.0
        elif slowing_since_s is not None:
            before_s = max(0.0, min(predicted_s, slowing_since_s - self.counted_s))
            slowing_s = max(0.0, now - max(slowing_since_s, self.counted_s))
            left = math.exp(-slowing_s / SLOWING_S)
            predicted_s = before_s + SLOWING_S * (1.0 - left)
        tangent = Pose(speed_mps * predicted_s, 0.0, rate_radps * predicted_s)
        twist = BodyTwist(left * speed_mps, 0.0, left * rate_radps)
        return OdometryReading(
            now,
            self.pose.moved(roll(tangent)),
            twist,
            self._total(self._unheard(ahead_s, now, blind_since_s)),
            SPEED_VARIANCES if blind_since_s is None else (BLIND_MPS**2, 1.0),
            self.rolled + tangent,
            twist if blind_since_s is None else None,
        )

    def _unheard(
        self, ahead_s: float, now: float, blind_since_s: float | None
    ) -> Iterable[tuple[float, float, float, float]]:
        """What may have been done since the last count."""
        if blind_since_s is not None:
            blind_s = max(0.0, now - blind_since_s)
            way_m, turn_rad = BLIND_MPS * blind_s, min(math.pi, 1.5 * blind_s)
        elif self.motion is Motion.NONE:
            return ()
        else:
            square_s2 = ahead_s * ahead_s / 2
            way_m, turn_rad = ACCELERATION_MPS2 * square_s2, ACCELERATION_RADPS2 * square_s2
        way_m2, turn_rad2 = way_m * way_m, turn_rad * turn_rad
        return (
            (way_m2, 1.0, 0.0, 0.0),
            (way_m2, 0.0, 1.0, 0.0),
            (turn_rad2, 0.0, 0.0, 1.0),
        )

    def _total(self, more: Iterable[tuple[float, float, float, float]]) -> Covariance:
        scale, drift = self.settings.wheel_scale**2, self.settings.gyro_drift_radps**2
        size, bias, bend = self._levers
        errors = [(scale, *size), (drift, *bias), (UNEQUAL**2, *bend)]
        return self._walk.with_errors([*errors, *more])
