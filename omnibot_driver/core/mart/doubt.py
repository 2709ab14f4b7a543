# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""How far the odometry of a MART robot may be off, and what makes it so.

A wheel that slips or has another size, a gyro that drifts, motors that differ where the heading is
unknown, the ends of motions, and replies whose time is known within the network's delay only. Knows
metres, rad and seconds; not where they come from.
"""

import math
from typing import Final

from omnibot_driver.core.mart.settings import MartSettings
from omnibot_driver.core.odometry.covariance import Covariance

WAY_STDDEV: Final = 0.004
"""m after 1 m, growing with its root."""
GYRO_WALK: Final = 0.002
"""rad after 1 s of motion, growing with its root: a gyro that is shaken."""
WHEEL_HEADING: Final = 0.06
"""Relative error of a turn that the right wheel alone tells."""
END_M, END_RAD = 0.004, math.radians(0.4)
"""Of each motion: how it begins, and rolls out."""
TOLD_TURN_RAD, TOLD_TURN = math.radians(0.7), 0.006
"""Of a turn on the spot that the server tells in whole degrees."""
PIVOT: Final = 0.01
"""Part of the track by which the middle of a turn on the spot is off."""
STRAIGHT_STDDEV_RAD: Final = math.radians(1.5)
"""Of a straight controlled move, whose heading the server holds."""
BEND_WALK: Final = 0.5
"""Part of a guessed turn's error that is another's in each step."""
ASTRAY: Final = 0.7
"""For rad² of the heading, part of the way that may lead elsewhere, ahead and aside."""
SPREAD: Final = 0.3
"""Standard deviation of a time that lies anywhere between two, as a part of what is between."""
CLOCK_S: Final = 0.01
"""A reply of a good network is as old as that, more or less."""
Errors = list[tuple[float, float, float, float]]


class Doubt:
    """``settings`` may be replaced. All of it is covariance in the odometry frame."""

    def __init__(self, settings: MartSettings) -> None:
        self.settings = settings
        self.reset()

    def reset(self) -> None:
        """The frame begins here."""
        self._walk = Covariance()
        self._levers = [(0.0, 0.0, 0.0)] * 5
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
        """The body moved so far. ``bend``: standard deviation of left over right, where they alone
        tell of a turn; ``aside_m``: of the way, by a heading of another time.
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
        yaw_variance = self._walk.yaw_yaw + self._levers[2][2] ** 2
        astray = min(1.0, ASTRAY * yaw_variance)
        own = (
            (dx_m, dy_m, 0.0),
            (0.0, 0.0, drift_rad),
            (bend_m * cos, bend_m * sin, bend_rad),
            (astray * dx_m, astray * dy_m, 0.0),
            (-astray * dy_m, astray * dx_m, 0.0),
        )
        self._levers = [
            (x - dy_m * yaw + own_x, y + dx_m * yaw + own_y, yaw + own_yaw)
            for (x, y, yaw), (own_x, own_y, own_yaw) in zip(self._levers, own, strict=True)
        ]

    def begin(self) -> None:
        """A motion has begun."""
        self._bend_before_rad = self._levers[2][2]

    def heading_told(self) -> None:
        """What was guessed of the turn of this motion is known now; where it led is not."""
        x_m, y_m, _ = self._levers[2]
        self._levers[2] = x_m, y_m, self._bend_before_rad

    def add(self, m2: float, rad2: float) -> None:
        """An error of the place, whichever way, and of the heading."""
        self._walk = self._walk.with_errors(_around(m2, rad2))

    def end(self) -> None:
        """A motion has ended."""
        self.add(END_M**2, END_RAD**2)

    def end_straight(self) -> None:
        """A straight controlled move has ended."""
        self.add(0.0, STRAIGHT_STDDEV_RAD**2)

    def end_turn(self, spun_rad: float, told_rad: float | None) -> None:
        """A turn on the spot has ended."""
        self._walk = self._walk.with_errors(self.turn(spun_rad, told_rad))

    def turn(self, spun_rad: float, told_rad: float | None) -> Errors:
        """Of a turn on the spot so far, by the wheel; ``told_rad``: by the server, if it has told
        it. The robot walks a little aside where its motors are unequal.
        """
        variance = (WHEEL_HEADING * spun_rad) ** 2
        if told_rad is not None:
            variance = TOLD_TURN_RAD**2 + (TOLD_TURN * told_rad) ** 2
        pivot_m = PIVOT * self.settings.track_m * min(1.0, abs(spun_rad))
        return anywhere(pivot_m, math.sqrt(variance))

    def total(self, more: Errors) -> Covariance:
        """With what may have been done since."""
        scale, drift = self.settings.wheel_scale**2, self.settings.gyro_drift_radps**2
        size, bias, *others = self._levers
        errors = [(scale, *size), (drift, *bias), *((1.0, *lever) for lever in others)]
        return self._walk.with_errors([*errors, *more])


def anywhere(way_m: float, turn_rad: float) -> Errors:
    """Within this of the prediction, as standard deviations."""
    return _around(way_m * way_m, turn_rad * turn_rad)


def _around(m2: float, rad2: float) -> Errors:
    return [(m2, 1.0, 0.0, 0.0), (m2, 0.0, 1.0, 0.0), (rad2, 0.0, 0.0, 1.0)]
