# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The uncertainty of the odometry of a MART robot.

Its sources: the wheel's size and slip, gyro drift, unequal motors, starts and stops, late replies.
This module knows metres, rad and seconds; it does not know how they are measured.
"""

import math
from typing import Final

from omnibot_driver.core.mart.settings import MartSettings
from omnibot_driver.core.odometry.covariance import Astray, Covariance

WAY_STDDEV: Final = 0.004
"""Standard deviation in m of a distance of 1 m.

The standard deviation grows with the square root of the distance.
"""
GYRO_WALK: Final = 0.002
"""Standard deviation in rad of the heading after 1 s of motion, which shakes the gyro.

The standard deviation grows with the square root of the time.
"""
WHEEL_HEADING: Final = 0.06
"""Relative standard deviation of a turn on the spot that is measured only by the right wheel."""
END_M, END_RAD = 0.004, math.radians(0.4)
"""Standard deviations of the errors that the start and the coasting of a motion cause.

``END_M``: position, in m. ``END_RAD``: heading, in rad.
"""
TOLD_TURN_RAD, TOLD_TURN = math.radians(0.7), 0.006
"""Standard deviations of the angle that the server reports for a turn on the spot.

``TOLD_TURN_RAD``: in rad, from rounding to whole degrees.

``TOLD_TURN``: a further error, as a fraction of the angle.
"""
PIVOT: Final = 0.01
"""Standard deviation of the distance between the robot's centre and the point about which it turns,
as a fraction of the track width. A turn of less than 1 rad has a proportionally smaller value."""
STRAIGHT_STDDEV_RAD: Final = math.radians(1.5)
"""Standard deviation in rad of the heading after a straight controlled move."""
BEND_WALK: Final = 0.5
"""Random error of a turn computed from commands, as a fraction of the turn's systematic error.

Both errors are standard deviations. The random error is independent in each interval between
encoder counts.
"""
SPREAD: Final = 0.3
"""Standard deviation of a time that is equally likely anywhere in an interval.

It is a fraction of the interval's length. The exact value is 1/√12.
"""
CLOCK_S: Final = 0.01
"""Uncertainty of a reply's time on a good network, in s. No smaller value is assumed."""
Errors = list[tuple[float, float, float, float]]


class Doubt:
    """The covariance of the pose in the odometry frame. ``settings`` may be replaced."""

    def __init__(self, settings: MartSettings) -> None:
        self.settings = settings
        self.reset()

    def reset(self) -> None:
        """Set all errors to zero, because the odometry frame begins at the robot's present pose."""
        self._walk = Covariance()
        self._astray = Astray()
        self._levers = [(0.0, 0.0, 0.0)] * 3
        self._bend_before_rad = 0.0

    def moved(
        self,
        heading_rad: float,
        way_m: float,
        turn_rad: float,
        seconds: float,
        *,
        on_the_spot: bool,
        bend: float,
        aside_m: float,
    ) -> None:
        """Extend the covariance by a displacement of ``way_m`` and ``turn_rad`` within ``seconds``.

        * ``heading_rad``: heading before the displacement, in the odometry frame.
        * ``bend``: standard deviation of the wheel speed ratio; 0 if the turn was measured.
        * ``aside_m``: standard deviation of the position across the motion, in m.
        """
        middle_rad = heading_rad + turn_rad / 2
        cos, sin = math.cos(middle_rad), math.sin(middle_rad)
        dx_m, dy_m = way_m * cos, way_m * sin
        walks = bool(way_m or turn_rad) and not on_the_spot
        turn_variance = GYRO_WALK**2 * seconds if walks else 0.0
        half_m = self.settings.track_m / 2
        bend_rad = bend * (way_m + turn_rad * half_m) / self.settings.track_m
        bend_m = -bend_rad * half_m
        errors = [
            (WAY_STDDEV**2 * abs(way_m), cos, sin, 0.0),
            (aside_m * aside_m, -sin, cos, 0.0),
            (turn_variance, 0.0, 0.0, 1.0),
            ((BEND_WALK * bend_rad) ** 2, -half_m * cos, -half_m * sin, 1.0),
        ]
        self._walk = self._walk.carried(dx_m, dy_m).with_errors(errors)
        drift_rad = seconds if way_m or turn_rad else 0.0
        self._astray.move(dx_m, dy_m, self._walk.yaw_yaw + self._levers[2][2] ** 2)
        own = (
            (dx_m, dy_m, 0.0),
            (0.0, 0.0, drift_rad),
            (bend_m * cos, bend_m * sin, bend_rad),
        )
        self._levers = [
            (x - dy_m * yaw + own_x, y + dx_m * yaw + own_y, yaw + own_yaw)
            for (x, y, yaw), (own_x, own_y, own_yaw) in zip(self._levers, own, strict=True)
        ]

    def begin(self) -> None:
        """Store the systematic heading error at the beginning of a motion.

        This error grows while the driver computes a turn from the commands. If the server reports
        the heading during the motion, ``heading_told`` restores the stored value.
        """
        self._bend_before_rad = self._levers[2][2]

    def heading_told(self) -> None:
        """Remove this motion's systematic heading error, because the server reports the heading.

        The random heading error and the position error stay.
        """
        x_m, y_m, _ = self._levers[2]
        self._levers[2] = x_m, y_m, self._bend_before_rad

    def add(self, m2: float, rad2: float) -> None:
        """Add independent errors of x, y and heading to the covariance.

        ``m2``: variance of x and of y, in m².

        ``rad2``: variance of the heading, in rad².
        """
        self._walk = self._walk.with_errors(_around(m2, rad2))

    def end(self) -> None:
        """Add the pose errors from the start and the coasting of a motion that has ended."""
        self.add(END_M**2, END_RAD**2)

    def end_straight(self) -> None:
        """Add the heading error of a straight controlled move that has ended."""
        self.add(0.0, STRAIGHT_STDDEV_RAD**2)

    def end_turn(self, spun_rad: float, told_rad: float | None) -> None:
        """Add the errors of a turn on the spot that has ended.

        ``spun_rad``: angle of the turn by the encoder of the right-hand wheel. ``told_rad``: angle
        of the turn that the server reported, or None.
        """
        self._walk = self._walk.with_errors(self.turn(spun_rad, told_rad))

    def turn_recorded(self, spun_rad: float, told_rad: float) -> None:
        """Replace the last turn's heading error: the server's record has the angle by the gyro.

        Call this before the position changes.
        """
        self.add(0.0, _by_gyro(told_rad) - _by_wheel(spun_rad))

    def turn(self, spun_rad: float, told_rad: float | None) -> Errors:
        """Return the variances of heading and position that a turn on the spot has caused so far.

        ``spun_rad``: angle by the wheel's encoder. ``told_rad``: angle that the server reported, or
        None.
        """
        variance = _by_wheel(spun_rad) if told_rad is None else _by_gyro(told_rad)
        pivot_m = PIVOT * self.settings.track_m * min(1.0, abs(spun_rad))
        return anywhere(pivot_m, math.sqrt(variance))

    def total(self, more: Errors) -> Covariance:
        """Return the covariance of the pose.

        ``more``: errors that arose after the last encoder count. The result includes them, but this
        object does not store them.
        """
        scale, drift = self.settings.wheel_scale**2, self.settings.gyro_drift_radps**2
        size, bias, bend = self._levers
        errors = [(scale, *size), (drift, *bias), (1.0, *bend), *_around(self._astray.m2, 0.0)]
        return self._walk.with_errors([*errors, *more])


def _by_wheel(spun_rad: float) -> float:
    return (WHEEL_HEADING * spun_rad) ** 2


def _by_gyro(told_rad: float) -> float:
    return TOLD_TURN_RAD**2 + (TOLD_TURN * told_rad) ** 2


def anywhere(way_m: float, turn_rad: float) -> Errors:
    """Return independent errors of x, y and heading, each as a variance and a unit vector.

    ``way_m``, ``turn_rad``: standard deviations of x and of y (m), and of the heading (rad).
    """
    return _around(way_m * way_m, turn_rad * turn_rad)


def _around(m2: float, rad2: float) -> Errors:
    return [(m2, 1.0, 0.0, 0.0), (m2, 0.0, 1.0, 0.0), (rad2, 0.0, 0.0, 1.0)]
