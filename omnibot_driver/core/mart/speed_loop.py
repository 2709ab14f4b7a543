# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The control of both motors: it computes the motor units for a wanted speed and turn rate.

The integral of the turn rate's error holds the heading. This module knows units, m/s and rad; it
does not know commands. The caller passes the time.
"""

import math
from itertools import product
from typing import Final

from omnibot_driver.core.mart.driven_wheel import DrivenWheel
from omnibot_driver.core.mart.motor_line import MOST_DEAD
from omnibot_driver.core.mart.motors import MOST_UNITS, UNEQUAL, Motors
from omnibot_driver.core.mart.settings import MartSettings

MOST_CHANGE: Final = 15
"""Largest change of a motor's units that one command may request.

The limit is small, because the network may duplicate a command. The server then changes the units
twice.
"""
MOST_BACKWARD: Final = 5
"""Largest change of a motor's units by one command in a backward drive on a slow network. The limit
is small, because the driver may not notice that the command arrives twice."""
SETTLE_S, LEARN_S = 0.45, 0.35
"""Times in s for learning from steady driving.

``SETTLE_S``: time for which the driver does not learn after a large change of the motors' units.

``LEARN_S``: shortest duration of the averaging window.
"""
LARGE_UNITS: Final = 3
MOST_MISSED: Final = 4
"""The driver remembers at most this number of unanswered changes of the motors' units.

From the measured speeds, the driver finds out which of these changes have arrived at the server.
"""
LEARN_TRIPS, LESS_PER_S = 4, 10.0
"""How the duration ``trip_s`` (s) of an exchange with the server affects measured motor speeds.

* The averaging window lasts at least ``LEARN_S + LEARN_TRIPS * trip_s``.
* The standard deviation of a measured speed is multiplied by ``1 + LESS_PER_S * trip_s``.
"""
SLOWEST_START_MPS: Final = 0.03
"""Lowest wheel speed in m/s with which the driver starts RM (forward).

At a lower speed, the server might not notice the motion.
"""
LEAST_UNITS: Final = 4
MORE_TIMES: Final = 3
"""Factor by which the driver raises the units of the next RM (forward) if no motor has turned.

The raise ends at MOST_DEAD. The commanded speed may need more units.
"""
HOLD_PER_S, HOLD_MOST_RAD = 1.0, 0.06
HOLD_AFTER_S: Final = 1.0
"""Time in s after a change of the commanded turn rate. During this time, the driver does not
integrate the heading error."""
NEW_RADPS: Final = 0.03
COPIED, MISSED, SLOW_TRIP_S = 0.4, 0.5, 0.03
"""How much less certain a new set-point makes the ratio of the wheel speeds.

The ratio's relative variance grows by factor * (relative change of the set-point)².

* ``COPIED``: factor in a slow network, in which a set-point may arrive twice.
* ``MISSED``: factor if the server did not answer the set-point.
* ``SLOW_TRIP_S``: average duration of an exchange, in s, above which a network is slow.
"""


class SpeedLoop(Motors):
    """The controller of both motors' speeds in one motion.

    ``trip_s``: average duration of an exchange with the server, in s.

    ``part``: last change of the motors' units, divided by the units before; sum over both motors.
    """

    def __init__(self, settings: MartSettings) -> None:
        super().__init__(settings)
        self.trip_s = 0.0
        self._right, self._left = DrivenWheel(self._right_line), DrivenWheel(self._left_line)
        self._least_units = LEAST_UNITS
        self._balance_is_measured = False
        self.begin(0, False, 0.0)

    def begin(self, units: int, reverse: bool, now: float) -> None:
        """Begin a motion with ``units`` on both sides."""
        self._right.units = self._left.units = units
        self._right.stood_s = self._left.stood_s = 0.0
        self._direction = -1.0 if reverse else 1.0
        self._rate_radps = self._error_rad = 0.0
        self._rate_changed_s = now
        self._unsure = 0.0
        self.part = 0.0
        self._change = (0, 0)
        self._copy = 0.0
        self._missed: list[tuple[int, int]] = []
        self._clear(now + SETTLE_S)

    def first_units(self, speed_mps: float, rate_radps: float) -> int:
        """Return the units with which RM (forward) starts both motors.

        The commanded speed of the slower wheel determines the units, from LEAST_UNITS to 60. After
        a start that turned no motor, the units can be higher.
        """
        right_mps, left_mps = self.sides(abs(speed_mps), rate_radps)
        slower_mps = max(SLOWEST_START_MPS, min(right_mps, left_mps))
        units = min(60, self._right.wanted_units(slower_mps / self.per_unit_mps))
        return max(self._least_units, units)

    def started(self) -> None:
        """Reduce the lowest units for the next start by one, because the motors have turned."""
        self._least_units = max(LEAST_UNITS, self._least_units - 1)

    def stood(self, units: int | None = None) -> None:
        """Record that neither motor turns, because the present motor units are too few.

        ``units``: the units of both motors; None for those last commanded. With MOST_DEAD units or
        more, a motor is regarded as blocked, and nothing is learned.
        """
        for side in (self._right, self._left):
            each = side.units if units is None else units
            if 0 < each < MOST_DEAD:
                if units is not None or not side.line.turns(each):
                    side.line.stood(each)
                self._least_units = max(self._least_units, min(round(MOST_DEAD), MORE_TIMES * each))

    @property
    def units(self) -> int:
        """The larger one of the two motors' units, 0 to 127."""
        return max(self._right.units, self._left.units)

    @property
    def blocked_s(self) -> float:
        """Time in s for which a wheel has not turned, although its motor has enough units.

        The longer one of the two wheels' times.
        """
        return max(self._right.stood_s, self._left.stood_s)

    @property
    def left_over_right(self) -> float:
        """Expected ratio of left to right wheel speed at the current motor units.

        The driver has learned how the speeds depend on the motor units. If both motors have equal
        units, the ratio is ``balance``.
        """
        return self._ratio(self._right.units, self._left.units)

    @property
    def balance(self) -> float:
        """Expected ratio of left to right motor speed if both motors have ``units``.

        The ratio differs from ``motor_balance`` by MOST_UNEQUAL at most.
        """
        return self._balance(self.units)

    @property
    def measured_balance(self) -> float | None:
        """Measured ratio of left to right motor speed if both motors have the same units.

        It is None until the ratio has been measured. Unlike ``balance``, the ratio is not limited.
        """
        return self._line_ratio(self.units) if self._balance_is_measured else None

    @property
    def bend(self) -> float:
        """Relative standard deviation of the expected wheel speed ratio (``left_over_right``)."""
        return math.sqrt(UNEQUAL**2 + self._unsure)

    def measured(
        self,
        way_m: float,
        turned_rad: float,
        seconds: float,
        now: float,
        *,
        right_only: bool = False,
    ) -> None:
        """Use a displacement, measured over ``seconds``, to learn how fast the motors turn.

        This also updates the heading error. ``right_only``: whether only the right wheel was
        measured, so that the left motor is assumed to change like the right one.
        """
        if now - self._rate_changed_s > HOLD_AFTER_S:
            error_rad = self._error_rad + self._rate_radps * seconds - turned_rad
            self._error_rad = max(-HOLD_MOST_RAD, min(HOLD_MOST_RAD, error_rad))
        if now - seconds < self._window_from_s:
            return
        self._window_s += seconds
        half_m = self.settings.track_m / 2
        for side, out_m in ((self._right, half_m), (self._left, -half_m)):
            side.window_units_s += side.units * seconds
            side.window_m += self._direction * (way_m + turned_rad * out_m)
        if self._window_s >= LEARN_S + LEARN_TRIPS * self.trip_s:
            self._judge_missed(right_only=right_only)
            doubt = 1.0 + LESS_PER_S * self.trip_s
            line = self._right.line
            slope, offset = line.slope, line.offset
            self._right.learn(self._window_s, self.per_unit_mps, doubt)
            if right_only:
                self._left.line.move(line.slope - slope, line.offset - offset)
            else:
                self._left.learn(self._window_s, self.per_unit_mps, doubt)
                self._balance_is_measured = True
            self._clear(now)

    def _judge_missed(self, *, right_only: bool) -> None:
        """Decide which requests to change the motors' units were lost, and undo them.

        The server has not answered these requests. The driver chooses the lost ones so that the
        motors' units fit the measured speeds best.
        """
        seconds, per_unit_mps = self._window_s, self.per_unit_mps

        def lacks(arrived: tuple[bool, ...]) -> tuple[int, int]:
            lost = [each for each, came in zip(self._missed, arrived, strict=True) if not came]
            return sum(right for right, _ in lost), sum(left for _, left in lost)

        def error(lacking: tuple[int, int]) -> float:
            right, left = lacking
            square = self._right.error(right, seconds, per_unit_mps) ** 2
            if right_only:
                return square
            return square + self._left.error(left, seconds, per_unit_mps) ** 2

        every = product((True, False), repeat=len(self._missed))
        best = min((lacks(arrived) for arrived in every), key=error)
        for side, less in zip((self._right, self._left), best, strict=True):
            side.units -= less
            side.window_units_s -= less * seconds
        self._missed.clear()

    def change(self, speed_mps: float, rate_radps: float, now: float) -> tuple[int, int] | None:
        """Return the changes of the right and the left motor's units, or None if both are zero.

        A positive change makes the motor faster. ``speed_mps`` is not negative; ``rate_radps`` is
        positive to the left.
        """
        if abs(rate_radps - self._rate_radps) > NEW_RADPS:
            self._rate_changed_s, self._error_rad = now, 0.0
        self._rate_radps = rate_radps
        held_radps = rate_radps + HOLD_PER_S * self._error_rad
        right_mps, left_mps = self.sides(speed_mps, self._direction * held_radps)
        most = MOST_BACKWARD if self._direction < 0.0 and self._is_slow else MOST_CHANGE
        right = self._right.wanted_units(right_mps / self.per_unit_mps)
        left = self._left.wanted_units(left_mps / self.per_unit_mps)
        if not (right or left):  # zero units on both sides would end the motion
            right, left = int(right_mps >= left_mps), int(left_mps >= right_mps)
        right = max(-most, min(most, right - self._right.units))
        left = max(-most, min(most, left - self._left.units))
        return (right, left) if right or left else None

    def changed(self, right: int, left: int, now: float) -> None:
        """Record a command that changes the units of the motors by ``right`` and ``left``.

        The driver assumes that the motors obey the command.
        """
        self.part = abs(right) / max(1, self._right.units) + abs(left) / max(1, self._left.units)
        self._unsure += (COPIED if self._is_slow else 0.0) * self.part**2
        self._change = self._right.change(right), self._left.change(left)
        sides = (self._right, right), (self._left, left)
        again = [min(MOST_UNITS, max(1, side.units + more)) for side, more in sides]
        wrong = self._ratio(*again)  # if the change arrives twice
        self._copy = max(self._copy, abs(wrong - self.left_over_right))
        if max(abs(right), abs(left)) >= LARGE_UNITS:
            self._clear(now + SETTLE_S)

    def missed(self) -> None:
        """Record that the server did not answer the last change of the motors' units.

        The change may not have arrived, so the wheel speed ratio is less certain.
        """
        self._unsure += MISSED * self.part**2
        self._missed = [*self._missed, self._change][-MOST_MISSED:]

    def answered_again(self) -> None:
        """Record that the server may have changed the motor units twice, because it answered twice.

        The uncertainty of the wheel speed ratio grows by the largest possible effect of the second
        change.
        """
        self._unsure += self._copy**2
        self._copy = 0.0

    @property
    def _is_slow(self) -> bool:
        """Whether the network is so slow that a change of the units may arrive twice."""
        return self.trip_s > SLOW_TRIP_S

    def _clear(self, from_s: float) -> None:
        """Begin a new averaging window at the time ``from_s``."""
        self._window_from_s = from_s
        self._window_s = 0.0
        for side in (self._right, self._left):
            side.window_units_s = side.window_m = 0.0
