# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Dead reckoning: the robot's pose at the last encoder count.

During a turn on the spot, the right wheel's encoder measures the angle. This module knows counts,
degrees and metres; it does not know commands. The caller passes the time.
"""

import math
from typing import Final

from omnibot_driver.core.geometry.se2 import Pose, roll
from omnibot_driver.core.mart.corrected_pose import (
    ANY_RAD,
    UNHEARD_M,
    UNHEARD_RAD,
    CorrectedPose,
)
from omnibot_driver.core.mart.doubt import CLOCK_S, SPREAD
from omnibot_driver.core.mart.mean_speeds import LEAST_S
from omnibot_driver.core.mart.moment import Moment
from omnibot_driver.core.mart.motors import UNEQUAL
from omnibot_driver.core.mart.relative_heading import RelativeHeading
from omnibot_driver.core.mart.settings import MartSettings
from omnibot_driver.core.mart.states import Motion
from omnibot_driver.core.mart.turn_angle import is_of_another
from omnibot_driver.core.mart.wheel_count import STRAY_COUNTS, WheelCount
from omnibot_driver.core.readings import NOTHING_MEASURED, DisplacementReading

BEGIN_RADPS: Final = 0.03
"""Standard deviation, in rad/s, of the turn rate that unequal motors cause in a forward drive (RM).

The value applies to the time before the first heading of the drive.
"""
BLIND_MPS: Final = 0.3
"""Standard deviation of the speed of a robot whose motion is unknown, in m/s."""
ACCELERATION_RADPS2: Final = 3.0
"""Standard deviation of the angular acceleration since the last measurement, in rad/s².

The last measurement is the last encoder count or the last heading.
"""
FRESH_S: Final = 0.2
"""Age of the last heading, in s, up to which the measured turn rate is valid."""
ROLLS_S, MOST_RADPS, UNREAD_MPS = 0.3, 1.5, 0.1
"""Assumptions about the end of a forward drive (RM), if no heading has come after the stop.

* ``ROLLS_S``: time in s for which the robot coasts.
* ``MOST_RADPS``: largest turn rate since the last heading, in rad/s.
* ``UNREAD_MPS``: standard deviation of the measured speed, in m/s.
"""


class Reckoning(CorrectedPose):
    """Dead reckoning by the encoder count and the relative heading.

    * ``motion``: the motion to which the next encoder count belongs; Motion.NONE after the last
      count of a motion.
    * ``stands``: whether the robot was stopped. It may still coast.
    * ``slowing_since_s``: time of the first stop command for this motion, or None.
    * ``left_over_right``: expected wheel speed ratio (left / right) while the heading is unknown,
      otherwise None.
    * ``bend``: standard deviation of ``left_over_right``.
    * ``begins_in_move``: whether the odometry was reset during the current controlled move.
    """

    def __init__(self, settings: MartSettings) -> None:
        super().__init__(settings)
        self.wheel = WheelCount()
        self.heading = RelativeHeading()
        self.motion, self.stands = Motion.NONE, True
        self.left_over_right: float | None = None
        self.bend = UNEQUAL
        self._began_s = self._stood_s = -math.inf
        self.slowing_since_s: float | None = None
        self._motion_rad = self.moved_m = 0.0
        self._guessed = False
        self.reset()

    def reset(self) -> None:
        """Move the origin of the odometry frame to the robot's current pose."""
        self.pose = Pose()
        self.doubt.reset()
        self.begins_in_move = self.motion in (Motion.STRAIGHT, Motion.TURN)
        self.turn.forget()

    def connect(self) -> None:
        """Begin a new connection; the robot may have moved, or the server may have restarted."""
        self.wheel.connect()
        if self.motion is Motion.NONE:
            self.heading.forget()
        else:
            self.doubt.add(UNHEARD_M**2, UNHEARD_RAD**2)
        self.speeds.forget()

    def appear(self) -> None:
        """Record that the server may have been restarted.

        After a restart, its encoder count and its heading begin at zero again.
        """
        self.wheel.appear()
        self.heading.may_begin_anew = True

    def begin(self, motion: Motion, now: float) -> None:
        """Record that the driver has started a motion. Its encoder count begins at 0."""
        if motion is not Motion.REFERENCE and self.heading.from_s < self._stood_s:
            self.heading.forget()  # on some servers, the last motion has changed the heading
        self.motion, self.stands = motion, False
        self._began_s, self._stood_s = now, math.inf
        self.slowing_since_s = None
        self.left_over_right, self.bend = None, UNEQUAL
        self.wheel.begin()
        self.doubt.begin()
        self.heading.begin(now, anew=motion is Motion.REFERENCE)
        self.turn.begin()
        self._motion_rad = self.moved_m = 0.0
        self._guessed = False

    def started(self, now: float, *, sure: bool) -> None:
        """Record that the server has acknowledged the start of the motion.

        ``sure``: whether the reply certainly answers the start command of this motion.
        """
        if sure:
            self.wheel.started()
        self.heading.changed_s = now

    def refused(self) -> None:
        """Record that the server knows of no motion, although the driver sent a start command."""
        if self.wheel.refused():
            self.lose_turn()

    def stopping(self, now: float) -> None:
        """Record that the driver has sent a stop command."""
        if self.slowing_since_s is None:
            self.slowing_since_s = now

    def stand(self, now: float) -> None:
        """Record that the robot was stopped. It may still coast."""
        self.stands, self._stood_s = True, now

    def rest(self, longest: float = math.inf) -> float:
        """End the motion; correct the heading, and return the correction in rad (``_end_turn``).

        Call this after the last encoder count, which includes the coasting. ``longest``: longest
        possible straight move in m, or largest turn in rad.
        """
        wrong_rad = 0.0
        if self.motion is Motion.NONE:
            return wrong_rad
        if self.on_the_spot:
            recorded = self.motion is Motion.TURN and not self.begins_in_move
            wrong_rad = self._end_turn(may_be_recorded=recorded)
        if self.motion is Motion.REFERENCE and self.heading.from_s < self._stood_s:
            self._doubt_unread_turn()
        self.doubt.end()
        way_m, turn_rad = self.maybe
        if abs(turn_rad if self.on_the_spot else way_m) <= longest:  # else the start was lost
            self.doubt.add(way_m**2, turn_rad**2)
        if self.begins_in_move:  # the part of the move before the reset is not known
            self.doubt.add(self.moved_m**2, self.turn.spun_rad**2)
        self.begins_in_move = False
        self.motion = Motion.NONE
        self.wheel.rest()
        self.slowing_since_s = None
        self.speeds.forget()
        return wrong_rad

    def _doubt_unread_turn(self) -> None:
        """Add an error to the pose at the end of a forward drive (RM).

        Call this if the last heading may have been measured before the stop, because the robot may
        have turned since then.
        """
        unread_s = max(0.0, self._stood_s + ROLLS_S - max(self.heading.told_s, self._began_s))
        most_rad = min(math.pi, MOST_RADPS * unread_s)
        turn_rad = min(
            most_rad, abs(self.heading.rate_radps) * unread_s + _turn_error_rad(unread_s)
        )
        way_m = self._fastest_mps * unread_s * min(1.0, turn_rad)
        self.doubt.add(way_m**2, turn_rad**2)

    @property
    def _fastest_mps(self) -> float:
        """The measured speed plus its standard deviation, in m/s."""
        return abs(self.speeds.means[0]) + UNREAD_MPS

    def turned(self, degrees: float, when: Moment) -> bool:
        """Process a reported heading in degrees; return whether it is plausible and has changed."""
        if when.from_s < self._began_s:
            return False
        known = self.heading.is_known
        angle_rad = math.radians(degrees)
        turn_rad = min(ANY_RAD, self.heading.doubt_rad(angle_rad, when.at_s))
        if turn_rad and self.motion is not Motion.NONE:
            way_m = self._fastest_mps * (when.at_s - self.heading.told_s) * min(1.0, turn_rad)
            self.doubt.add(way_m**2, turn_rad**2)
        changed = self.heading.tell(angle_rad, when, self._stood_s, self._settings.heading_scale)
        if not known and self.heading.is_known and self.motion is Motion.REFERENCE:
            self.doubt.add(0.0, (BEGIN_RADPS * (when.at_s - self._began_s)) ** 2)
        return changed

    def guess_changed(self, part: float, late_s: float) -> None:
        """Add a heading error, because it is uncertain when the wheel speed ratio changes.

        ``part``: relative change of the ratio. ``late_s``: length in s of the interval that
        contains the change.
        """
        turn_rad = part * abs(self.speeds.means[0]) * late_s / self._settings.track_m
        self.doubt.add(0.0, turn_rad * turn_rad)

    def counted(self, count: int, when: Moment) -> DisplacementReading | None:
        """Process a count of the right wheel; return the displacement since the last count.

        If the count is implausible or too old, return None. If the displacement is unknown, return
        NOTHING_MEASURED.
        """
        if when.from_s < self._began_s:
            return None
        settings = self._settings
        speed_mps, rate_radps = self.speeds.means
        step = self.wheel.tell(
            count,
            when,
            settings.metres_per_count,
            speed_mps + rate_radps * settings.track_m / 2,
            self._stood_s,
            rests=self.motion is Motion.NONE,
        )
        if step is None:
            return None
        self.speeds.spread_s = max(CLOCK_S, when.spread_s)
        if step.lost:
            self.doubt.add((BLIND_MPS * step.seconds) ** 2, ANY_RAD**2)
        if step.unsure:
            self.doubt.add(step.wheel_m**2, self._rim_rad(step.wheel_m) ** 2)
        if not step.seconds or (step.lost and not step.wheel_m):
            return NOTHING_MEASURED
        turn_rad = self._turn_rad(step.wheel_m, when.at_s, step.seconds)
        way_m = 0.0 if self.on_the_spot else step.wheel_m - turn_rad * settings.track_m / 2
        self._move(way_m, turn_rad, step.seconds, step.wheel_m)
        return DisplacementReading(way_m, 0.0, turn_rad, "body", max(step.seconds, LEAST_S), 0)

    @property
    def maybe(self) -> tuple[float, float]:
        """Motion that may be missing in the pose: right wheel's distance in m, and turn in rad.

        Both values are zero, except while the last encoder count may be older than the motion.
        """
        wheel_m = self.wheel.maybe * self._settings.metres_per_count
        return wheel_m, self._rim_rad(wheel_m)

    def _rim_rad(self, wheel_m: float) -> float:
        """Return the turn in rad that moves the right wheel by ``wheel_m`` in a turn on the spot.

        In any other motion, the result is 0.
        """
        return 2 * wheel_m / self._settings.track_m if self.on_the_spot else 0.0

    @property
    def on_the_spot(self) -> bool:
        """Whether the motion is a turn on the spot."""
        return self.motion in (Motion.SPIN, Motion.TURN)

    def _turn_rad(self, wheel_m: float, at_s: float, seconds: float) -> float:
        turned_rad = self.heading.turned_rad(at_s, stands=self.stands)
        told_rad = turned_rad - self._motion_rad
        if self.motion is Motion.NONE and not wheel_m:
            self._motion_rad = turned_rad
            return 0.0  # on some servers the heading of a robot at rest drifts
        ratio = self.left_over_right
        if not self.on_the_spot:
            if ratio is None:
                return told_rad - self._correct_guess(told_rad, seconds)
            self._guessed = True
            return wheel_m * (1.0 - ratio) / self._settings.track_m
        turn_rad = wheel_m * (1.0 - (-1.0 if ratio is None else ratio)) / self._settings.track_m
        if self.motion is Motion.TURN and not is_of_another(told_rad - turn_rad, turn_rad):
            turn_rad = told_rad
        return self.turn.add(turn_rad)

    def _correct_guess(self, told_rad: float, seconds: float) -> float:
        """Correct a heading computed from commands, after the server has reported the turn.

        Return the correction in rad, which is not a motion of the robot.
        """
        if not self._guessed:
            return 0.0
        self._guessed = False
        self.doubt.heading_told()
        wrong_rad = told_rad - self.heading.rate_radps * seconds
        self._correct_yaw(wrong_rad)
        self._motion_rad += wrong_rad
        return wrong_rad

    def _move(self, way_m: float, turn_rad: float, seconds: float, wheel_m: float) -> None:
        tangent = Pose(way_m, 0.0, turn_rad)
        before = self.pose
        self.pose = before.moved(roll(tangent))
        self.rolled += tangent
        self._motion_rad += turn_rad
        self.moved_m += way_m
        self.speeds.add(self.wheel.told_s, way_m, turn_rad)
        guessed = self.motion is Motion.REVERSE and self.left_over_right is not None
        late_rad = self.heading.rate_radps * self.speeds.spread_s
        mistimed_rad = abs(late_rad + turn_rad * min(seconds, 1.0))
        mistimed_rad += min(1.0, self.stale(self.wheel.told_s)[1])
        self.doubt.moved(
            before.yaw_rad,
            way_m,
            turn_rad,
            seconds,
            on_the_spot=self.on_the_spot,
            bend=self.bend if guessed else 0.0,
            aside_m=way_m * SPREAD * mistimed_rad,
        )
        stray_m = STRAY_COUNTS * abs(self._settings.metres_per_count)
        if self.motion is Motion.NONE and abs(wheel_m) > stray_m:
            self.doubt.add(wheel_m**2, (2 * wheel_m / self._settings.track_m) ** 2)

    def stale(self, now: float) -> tuple[float, float]:
        """Return for how many s the turn rate has been out of date, and the heading's error.

        The error is a standard deviation in rad. Both values are 0 except in a forward drive (RM).
        """
        stale_s = max(0.0, now - max(self.heading.told_s, self._began_s) - FRESH_S)
        if self.motion is not Motion.REFERENCE:
            stale_s = 0.0
        return stale_s, _turn_error_rad(stale_s)


def _turn_error_rad(seconds: float) -> float:
    """Return the standard deviation, in rad, of a turn that is predicted over ``seconds``.

    Only the turn rate at the beginning is known.
    """
    return min(math.pi, ACCELERATION_RADPS2 * seconds * seconds / 2)
