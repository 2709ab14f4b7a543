# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Where the robot was when it was counted, by the way of its right wheel and the relative heading.

The server reports the heading while RM drives; of a turn on the spot the wheel gives it until the
reply to SM does; of a controlled move nothing is known before its end. Knows counts, degrees and
metres; no words. Time is an argument.
"""

import math
from collections import deque
from typing import Final

from omnibot_driver.core.geometry.se2 import Pose, roll
from omnibot_driver.core.mart.doubt import CLOCK_S, SPREAD, Doubt
from omnibot_driver.core.mart.moment import Moment
from omnibot_driver.core.mart.relative_heading import RelativeHeading
from omnibot_driver.core.mart.settings import MartSettings
from omnibot_driver.core.mart.speed_loop import UNEQUAL
from omnibot_driver.core.mart.states import Motion
from omnibot_driver.core.mart.wheel_count import STRAY_COUNTS, WheelCount
from omnibot_driver.core.readings import NOTHING_MEASURED, DisplacementReading

WINDOW_S, SPREADS = 0.35, 4
"""Speeds are averages over this time, or over this multiple of a reply's uncertainty if longer."""
LEAST_S: Final = 0.05
TOLD_RAD, TOLD_PART = 0.05, 0.3
"""A reported turn that is further from the wheel's turn is the answer to another question."""
BEGIN_RADPS: Final = 0.03
"""Turn rate of unequal motors that begin alike, before the first heading."""
BLIND_MPS: Final = 0.3
"""A robot of which nothing is heard is anywhere within this speed."""
UNHEARD_M, UNHEARD_RAD = 0.4, 0.3
"""What a motion may have done of which the end was not heard."""
ANY_RAD: Final = 1.8
"""Any heading, as a standard deviation."""


class Reckoning:
    """``pose``: at the last count. ``stands``: it was stopped. ``left_over_right``: of the wheels'
    speeds, where the heading is unknown and the commanded speeds have to do; ``bend``: its standard
    deviation.
    """

    def __init__(self, settings: MartSettings) -> None:
        self._settings = settings
        self.doubt = Doubt(settings)
        self.wheel = WheelCount()
        self.heading = RelativeHeading()
        self.motion, self.stands = Motion.NONE, True
        self.rolled = Pose()
        self.left_over_right: float | None = None
        self.bend = UNEQUAL
        self._began_s = self._stood_s = -math.inf
        self.slowing_since_s: float | None = None
        self._track: deque[tuple[float, float, float]] = deque(maxlen=40)
        self._way_m = self._yaw_rad = self._motion_rad = 0.0
        self.spun_rad = self.moved_m = 0.0
        self.told_rad: float | None = None
        self._guessed = False
        self.spread_s = CLOCK_S
        self.reset()

    @property
    def settings(self) -> MartSettings:
        """Sizes and scales; may be replaced."""
        return self._settings

    @settings.setter
    def settings(self, settings: MartSettings) -> None:
        self._settings = self.doubt.settings = settings

    def reset(self) -> None:
        """The frame begins here."""
        self.pose = Pose()
        self.doubt.reset()

    def connect(self) -> None:
        """The server was not heard for long: it may have gone on, or have begun anew."""
        self.wheel.connect()
        if self.motion is Motion.NONE:
            self.heading.forget()
        else:
            self.doubt.add(UNHEARD_M**2, UNHEARD_RAD**2)
        self.forget_speeds()

    def begin(self, motion: Motion, now: float) -> None:
        """A motion has begun, and the count with it."""
        self.motion, self.stands = motion, False
        self._began_s, self._stood_s = now, math.inf
        self.slowing_since_s = None
        self.left_over_right, self.bend = None, UNEQUAL
        self.wheel.begin()
        self.doubt.begin()
        self.heading.begin(now, anew=motion is Motion.REFERENCE)
        self._motion_rad = self.spun_rad = self.moved_m = 0.0
        self.told_rad, self._guessed = None, False

    def started(self, now: float, *, sure: bool) -> None:
        """The server has answered that it has. ``sure``: its answer is not another's."""
        if sure:
            self.wheel.started()
        self.heading.changed_s = now

    def stopping(self, now: float) -> None:
        """A stop was sent to the robot."""
        if self.slowing_since_s is None:
            self.slowing_since_s = now

    def stand(self, now: float) -> None:
        """It was stopped; how it rolled out is not counted yet."""
        self.stands, self._stood_s = True, now

    def rest(self) -> None:
        """The motion is over, and how it rolled out is counted."""
        if self.motion is Motion.NONE:
            return
        if self.on_the_spot:
            self._finish_turn()
        self.doubt.end()
        way_m, turn_rad = self.maybe
        self.doubt.add(way_m**2, turn_rad**2)
        self.motion = Motion.NONE
        self.wheel.rest()
        self.slowing_since_s = None
        self.forget_speeds()

    def turned(self, degrees: float, when: Moment) -> bool:
        """The relative angle; whether it is believed, and has changed."""
        if when.from_s < self._began_s:
            return False
        known = self.heading.is_known
        angle_rad = math.radians(degrees) * self._settings.heading_sign
        changed = self.heading.tell(angle_rad, when, self._stood_s)
        if not known and self.heading.is_known and self.motion is Motion.REFERENCE:
            self.doubt.add(0.0, (BEGIN_RADPS * (when.at_s - self._began_s)) ** 2)
        return changed

    def guess_changed(self, part: float, late_s: float) -> None:
        """The sides were changed against each other by this part, some time within this."""
        turn_rad = part * abs(self.speeds[0]) * late_s / self._settings.track_m
        self.doubt.add(0.0, turn_rad * turn_rad)

    def counted(self, count: int, when: Moment) -> DisplacementReading | None:
        """The right wheel's count; None for one that cannot be believed, or may be of an earlier
        motion.
        """
        if when.from_s < self._began_s:
            return None
        settings = self._settings
        speed_mps, rate_radps = self.speeds
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
        self.spread_s = max(CLOCK_S, when.spread_s)
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
        """In m and rad, what a motion has done that may not have begun."""
        wheel_m = self.wheel.maybe * self._settings.metres_per_count
        return wheel_m, self._rim_rad(wheel_m)

    def _rim_rad(self, wheel_m: float) -> float:
        """The turn on the spot that takes the wheel so far; zero in other motions."""
        return 2 * wheel_m / self._settings.track_m if self.on_the_spot else 0.0

    @property
    def on_the_spot(self) -> bool:
        return self.motion in (Motion.SPIN, Motion.TURN)

    def _turn_rad(self, wheel_m: float, at_s: float, seconds: float) -> float:
        """Since the last count."""
        turned_rad = self.heading.turned_rad(at_s, stands=self.stands)
        told_rad = turned_rad - self._motion_rad
        if self.motion is Motion.NONE and not wheel_m:
            self._motion_rad = turned_rad
            return 0.0  # some servers let the heading of a standing robot drift
        ratio = self.left_over_right
        if not self.on_the_spot:
            if ratio is None:
                return told_rad - self._correct_guess(told_rad, seconds)
            self._guessed = True
            return wheel_m * (1.0 - ratio) / self._settings.track_m
        turn_rad = wheel_m * (1.0 - (-1.0 if ratio is None else ratio)) / self._settings.track_m
        told = abs(told_rad - turn_rad) < TOLD_RAD + TOLD_PART * abs(turn_rad)
        if self.motion is Motion.TURN and told:
            turn_rad = told_rad
        self.spun_rad += turn_rad
        return turn_rad if self.told_rad is None else 0.0  # the reported turn includes it

    def _correct_guess(self, told_rad: float, seconds: float) -> float:
        """Correct the guessed part of this motion's turn when the first heading is reported. The
        correction is not a motion of the robot. Returns it in rad.
        """
        if not self._guessed:
            return 0.0
        self._guessed = False
        self.doubt.heading_told()
        wrong_rad = told_rad - self.heading.rate_radps * seconds
        self._correct_yaw(wrong_rad)
        self._motion_rad += wrong_rad
        return wrong_rad

    def spin_told(self, degrees: float) -> None:
        """What the server has measured of a turn on the spot that is over, in the board's sign."""
        self.told_rad = math.radians(degrees) * self._settings.heading_sign
        self._correct_yaw(self.told_rad - self.spun_rad)

    def _correct_yaw(self, wrong_rad: float) -> None:
        self.pose = Pose(self.pose.x_m, self.pose.y_m, self.pose.yaw_rad + wrong_rad)
        self.rolled += Pose(0.0, 0.0, wrong_rad)
        self._yaw_rad += wrong_rad

    def _finish_turn(self) -> None:
        """A turn on the spot is over, and counted. The reported angle may be another number."""
        told_rad = self.told_rad
        wrong_rad = 0.0 if told_rad is None else self.spun_rad - told_rad
        if abs(wrong_rad) > TOLD_RAD + TOLD_PART * abs(self.spun_rad):
            self._correct_yaw(wrong_rad)
            told_rad = None
        self.doubt.end_turn(self.spun_rad, told_rad)
        self.told_rad = None

    def finish_straight(self) -> None:
        """A straight controlled move is over: its heading was held, as far as the server can."""
        self.doubt.end_straight()

    def _move(self, way_m: float, turn_rad: float, seconds: float, wheel_m: float) -> None:
        tangent = Pose(way_m, 0.0, turn_rad)
        before = self.pose
        self.pose = before.moved(roll(tangent))
        self.rolled += tangent
        self._way_m += way_m
        self._yaw_rad += turn_rad
        self._motion_rad += turn_rad
        self.moved_m += way_m
        self._track.append((self.wheel.told_s, self._way_m, self._yaw_rad))
        guessed = self.motion is Motion.REVERSE and self.left_over_right is not None
        mistimed_rad = self.heading.rate_radps * self.spread_s + turn_rad * min(seconds, 1.0)
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

    @property
    def speeds(self) -> tuple[float, float]:
        """m/s and rad/s over the last ``WINDOW_S``, and over two counts at least; else zero."""
        if len(self._track) < 2:
            return 0.0, 0.0
        newest_s, way_m, yaw_rad = self._track[-1]
        from_s = min(newest_s - self.window_s, self._track[-2][0])
        at_s, then_m, then_rad = next(each for each in self._track if each[0] >= from_s)
        seconds = max(newest_s - at_s, 1e-3)
        return (way_m - then_m) / seconds, (yaw_rad - then_rad) / seconds

    @property
    def speed_changes(self) -> tuple[float, float]:
        """m/s and rad/s by which it was faster or slower between the last two counts."""
        if len(self._track) < 2:
            return 0.0, 0.0
        (then_s, then_m, then_rad), (at_s, way_m, yaw_rad) = self._track[-2], self._track[-1]
        seconds = max(at_s - then_s, LEAST_S)
        speed, rate = self.speeds
        return (way_m - then_m) / seconds - speed, (yaw_rad - then_rad) / seconds - rate

    @property
    def window_s(self) -> float:
        return max(WINDOW_S, SPREADS * self.spread_s)

    def forget_speeds(self) -> None:
        """What is counted next is another motion."""
        self._track.clear()
