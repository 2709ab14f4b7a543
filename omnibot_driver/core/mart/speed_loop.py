# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""From speed and turn rate to the units of two motors, closed by what is measured.

The controller takes changes of its units, and applies them without a regulator: what comes of a
unit depends on voltage, motor and floor. So each side has a gain that is learned from windows of
steady driving; the heading is held by its integral. Knows units, m/s and rad; no words. Time is an
argument.
"""

import math
from dataclasses import dataclass
from typing import Final

from omnibot_driver.core.mart.motor_line import MotorLine
from omnibot_driver.core.mart.settings import MartSettings

MOST_UNITS: Final = 127
MOST_CHANGE: Final = 15
"""Units in one exchange: all that a command which arrives twice can do too much."""
MOST_BACKWARD: Final = 5
"""The same in B on a slow network, where nothing may tell that it came twice."""
SETTLE_S, LEARN_S = 0.45, 0.35
"""After a larger change nothing is learned for this time; then once in this time."""
LARGE_UNITS: Final = 3
LEARNED: Final = 0.7
"""Part of what a window shows that is taken over at once."""
LEARN_TRIPS, LESS_PER_S = 4, 10.0
"""Where exchanges take long the window is longer, and less is taken over."""
LOWEST_GAIN, HIGHEST_GAIN = 0.4, 2.5
SLOWEST_MPS: Final = 0.03
"""Of a wheel whose gain can be learned."""
SLOWEST_TURN_RADPS: Final = 0.05
"""On the spot, of which anything is learned."""
HOLD_PER_S, HOLD_MOST_RAD = 1.0, 0.06
HOLD_AFTER_S: Final = 1.0
"""A change of the turn rate takes this time; its lag is not an error to correct."""
NEW_RADPS: Final = 0.03
UNEQUAL: Final = 0.04
"""Of two motors, where nothing but what is commanded tells of a turn."""
MOST_UNEQUAL: Final = 2 * UNEQUAL
"""A larger difference that was learned is not believed."""
COPIED, MISSED, SLOW_TRIP_S = 0.4, 0.5, 0.03
"""Variance of a change that came twice on a slow network, or did not come, for its square. More
than is probable, as a wrong guess stays for the whole motion.
"""
LONGEST_STEP_S: Final = 0.2


@dataclass(slots=True)
class _Side:
    """One motor. ``units``: as commanded; ``gain``: measured speed over the nominal one."""

    units: int = 0
    gain: float = 1.0
    window_units_s: float = 0.0
    window_m: float = 0.0

    def learn(self, per_unit_mps: float, part: float) -> None:
        """From the window that is over, by this part."""
        nominal_m = self.window_units_s * per_unit_mps
        if nominal_m > 0.0 and self.window_m > 0.0:
            seen = min(HIGHEST_GAIN, max(LOWEST_GAIN, self.window_m / nominal_m))
            self.gain += part * (seen - self.gain)

    def wanted_units(self, speed_mps: float, per_unit_mps: float) -> int:
        """For this speed, by the gain."""
        return round(min(MOST_UNITS, max(0.0, speed_mps / (per_unit_mps * self.gain))))


class SpeedLoop:
    """``settings`` may be replaced; ``volts`` is the battery's, as last told; ``trip_s``: what an
    exchange takes, by which the times of measurements are uncertain; ``part``: by which the last
    change has changed the sides against each other.
    """

    def __init__(self, settings: MartSettings) -> None:
        self.settings = settings
        self.volts = settings.nominal_volts
        self.trip_s = 0.0
        self._right, self._left = _Side(), _Side()
        self._line = MotorLine()
        self.begin(0, False, 0.0)

    def begin(self, units: int, reverse: bool, now: float) -> None:
        """A motion has begun with these units on both sides."""
        self._right.units = self._left.units = units
        self._direction = -1.0 if reverse else 1.0
        self._rate_radps = self._error_rad = 0.0
        self._rate_changed_s = now
        self._measured_s = now
        self._unsure = 0.0
        self.part = 0.0
        self._clear(now + SETTLE_S)

    def first_units(self, speed_mps: float, rate_radps: float) -> int:
        """To begin with on both sides, for a speed along the motion: that of the slower side."""
        right_mps, left_mps = self.sides(abs(speed_mps), rate_radps)
        slower = min(right_mps, left_mps, key=abs)
        return max(4, min(60, self._right.wanted_units(max(slower, 0.0), self._per_unit_mps)))

    def spin_units(self, rate_radps: float) -> int:
        """For a turn on the spot."""
        rim_mps = abs(rate_radps) * self.settings.track_m / 2
        return max(2, min(MOST_UNITS, round(self._line.units(rim_mps / self._per_unit_mps))))

    def spun(self, units: int, rate_radps: float) -> None:
        """A turn with these units had this mean rate: both sides together."""
        if abs(rate_radps) > SLOWEST_TURN_RADPS:
            rim_mps = abs(rate_radps) * self.settings.track_m / 2
            self._line.learn(units, rim_mps / self._per_unit_mps)

    @property
    def left_over_right(self) -> float:
        """Of the wheels' speeds, by the units and the balance of both motors."""
        right = self._right.units
        return self._left.units * self.balance / right if right else 1.0

    @property
    def bend(self) -> float:
        """Standard deviation of ``left_over_right``, as a part."""
        return math.sqrt(UNEQUAL**2 + self._unsure)

    @property
    def balance(self) -> float:
        """The left motor's gain over the right one's, as far as it is believed: what was learned
        while a change of the units was lost or came twice includes that change.
        """
        ratio = self._left.gain / self._right.gain
        return min(1.0 + MOST_UNEQUAL, max(1.0 - MOST_UNEQUAL, ratio))

    def sides(self, speed_mps: float, rate_radps: float) -> tuple[float, float]:
        """Speeds of right and left in m/s. None goes back: the inner one stands at most."""
        half = rate_radps * self.settings.track_m / 2
        return max(0.0, speed_mps + half), max(0.0, speed_mps - half)

    def measured(
        self,
        speed_mps: float,
        rate_radps: float,
        turned_rad: float,
        now: float,
        *,
        right_only: bool = False,
    ) -> None:
        """What the robot does, and how far it has turned since the last call. ``right_only``: the
        right wheel alone was measured; the left motor is taken to have changed as the right one.
        """
        seconds = min(max(0.0, now - self._measured_s), LONGEST_STEP_S)
        self._measured_s = now
        if now - self._rate_changed_s > HOLD_AFTER_S:
            error_rad = self._error_rad + self._rate_radps * seconds - turned_rad
            self._error_rad = max(-HOLD_MOST_RAD, min(HOLD_MOST_RAD, error_rad))
        if now < self._window_from_s:
            return
        self._window_s += seconds
        half = self._direction * rate_radps * self.settings.track_m / 2
        along_mps = self._direction * speed_mps
        for side, rim_mps in ((self._right, along_mps + half), (self._left, along_mps - half)):
            if rim_mps > SLOWEST_MPS:
                side.window_units_s += side.units * seconds
                side.window_m += rim_mps * seconds
        if now - self._window_from_s >= LEARN_S + LEARN_TRIPS * self.trip_s:
            before = self._right.gain
            part = LEARNED / (1.0 + LESS_PER_S * self.trip_s)
            self._right.learn(self._per_unit_mps, part)
            if right_only:
                self._left.gain *= self._right.gain / before
            else:
                self._left.learn(self._per_unit_mps, part)
                self._learn_line()
            self._clear(now)

    def _learn_line(self) -> None:
        """From the window that is over: of both motors, as a turn on the spot needs both."""
        seconds = self._window_s
        if min(self._right.window_m, self._left.window_m) > SLOWEST_MPS * seconds:
            units = (self._right.window_units_s + self._left.window_units_s) / (2 * seconds)
            speed_mps = (self._right.window_m + self._left.window_m) / (2 * seconds)
            self._line.learn(units, speed_mps / self._per_unit_mps, 1.0 + LESS_PER_S * self.trip_s)

    def change(self, speed_mps: float, rate_radps: float, now: float) -> tuple[int, int] | None:
        """What to add to right and left, positive along the motion; None for nothing.

        ``speed_mps`` is along the motion and not negative; ``rate_radps`` to the left.
        """
        if abs(rate_radps - self._rate_radps) > NEW_RADPS:
            self._rate_changed_s, self._error_rad = now, 0.0
        self._rate_radps = rate_radps
        held_radps = rate_radps + HOLD_PER_S * self._error_rad
        right_mps, left_mps = self.sides(speed_mps, self._direction * held_radps)
        most = MOST_BACKWARD if self._direction < 0.0 and self._is_slow else MOST_CHANGE
        steps = []
        for side, rim_mps in ((self._right, right_mps), (self._left, left_mps)):
            wanted = side.wanted_units(rim_mps, self._per_unit_mps)
            steps.append(max(-most, min(most, wanted - side.units)))
        right, left = steps
        if self._right.units + right <= 0 and self._left.units + left <= 0:
            return None
        return (right, left) if right or left else None

    def changed(self, right: int, left: int, now: float) -> None:
        """That was sent; it is taken for obeyed, and the measurement tells if it was not."""
        self.part = abs(right) / max(1, self._right.units) + abs(left) / max(1, self._left.units)
        self._unsure += (COPIED if self._is_slow else 0.0) * self.part**2
        self._right.units = min(MOST_UNITS, max(0, self._right.units + right))
        self._left.units = min(MOST_UNITS, max(0, self._left.units + left))
        if max(abs(right), abs(left)) >= LARGE_UNITS:
            self._clear(now + SETTLE_S)

    def missed(self) -> None:
        """The last change was not answered: it was obeyed, or not."""
        self._unsure += MISSED * self.part**2

    @property
    def _is_slow(self) -> bool:
        """Whether the network is one on which a change may come twice."""
        return self.trip_s > SLOW_TRIP_S

    @property
    def _per_unit_mps(self) -> float:
        settings = self.settings
        return settings.speed_per_unit * self.volts / settings.nominal_volts

    def _clear(self, from_s: float) -> None:
        """A new window begins."""
        self._window_from_s = from_s
        self._window_s = 0.0
        for side in (self._right, self._left):
            side.window_units_s = side.window_m = 0.0


def turn_is_on_the_spot(speed_mps: float, rate_radps: float, track_m: float) -> bool:
    """Whether it is nearer to a turn on the spot than to one about a standing wheel."""
    return abs(speed_mps) < 0.5 * abs(rate_radps) * track_m / 2 or math.isclose(speed_mps, 0.0)
