# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A motor's speed as a function of its motor units: a straight line that the driver learns.

A command sets the motor units, 0 to 127. Speeds are in nominal units: at 10 motor units, an ideal
motor has the speed 10. This module does not know wheels or time.
"""

import math
from typing import Final

LOWEST_SLOPE, HIGHEST_SLOPE = 0.4, 2.5
MOST_DEAD: Final = 20.0
"""Largest number of units that a motor is assumed to need before it turns."""
SLOPE_SD, OFFSET_SD = 0.3, 4.0
"""Standard deviations of ``slope`` and ``offset`` in a MotorLine before it has learned anything.

The offset is in nominal units.
"""
SLOPE_DRIFT, OFFSET_DRIFT = 0.01, 0.2
"""Standard deviations of the changes of ``slope`` and ``offset`` between two measurements.

The offset is in nominal units.
"""
SURE: Final = 3.0
"""A motor certainly turns if its expected speed is above zero by more than this number of standard
deviations."""
NOISE, NOISE_PART = 0.3, 0.02
"""Standard deviation of a measured speed, in nominal units.

It is NOISE, plus NOISE_PART times the commanded units.
"""


class MotorLine:
    """A motor's speed as a linear function of its motor units: ``slope * units + offset``.

    A Kalman filter learns slope and offset, in nominal units. The argument ``slope`` is the initial
    slope.
    """

    def __init__(self, slope: float = 1.0) -> None:
        self.slope, self.offset = slope, 0.0
        self._learned = False
        self._ss, self._so, self._oo = SLOPE_SD**2, 0.0, OFFSET_SD**2

    def learn(self, units: float, speed: float, doubt: float = 1.0) -> None:
        """Correct ``slope`` and ``offset`` by a measured speed.

        ``units``: the motor units at which the speed was measured.

        ``speed``: the measured speed, in nominal units.

        ``doubt``: factor for the assumed standard deviation of the measured speed.
        """
        self._learned = True
        if self._ss < SLOPE_SD**2:
            self._ss += SLOPE_DRIFT**2
        if self._oo < OFFSET_SD**2:
            self._oo += OFFSET_DRIFT**2
        to_slope = self._ss * units + self._so
        to_offset = self._so * units + self._oo
        noise = (NOISE + NOISE_PART * units) * doubt
        variance = to_slope * units + to_offset + noise * noise
        error = speed - self.speed(units)
        slope = self.slope + to_slope / variance * error
        offset = self.offset + to_offset / variance * error
        self._ss -= to_slope * to_slope / variance
        self._so -= to_slope * to_offset / variance
        self._oo -= to_offset * to_offset / variance
        if offset > 0.0 and error > 0.0:
            # the offset is limited to 0: take the slope that fits this offset, because otherwise
            # the line would fall although the motor is faster than expected
            slope -= self._so / self._oo * offset
        self._set(slope, offset)

    def stood(self, units: float) -> None:
        """Lower ``offset`` until the expected speed at ``units`` is zero: the motor has not turned.

        An obstacle may be the cause, so ``offset`` becomes as uncertain as at the beginning.
        """
        self._set(self.slope, min(self.offset, -self.slope * units))
        self._so, self._oo = 0.0, OFFSET_SD**2

    def move(self, slope: float, offset: float) -> None:
        """Add to this motor's line the changes that a measurement made to the other motor's line.

        ``slope``, ``offset``: these changes. This motor itself was not measured.
        """
        self._learned = True
        self._set(self.slope + slope, self.offset + offset)

    def turns(self, units: float) -> bool:
        """Return whether the motor certainly turns with ``units`` if nothing blocks it."""
        variance = self._ss * units * units + 2 * self._so * units + self._oo
        noise = NOISE + NOISE_PART * units
        return self._learned and self.speed(units) > SURE * math.hypot(math.sqrt(variance), noise)

    def restore(self, before: "MotorLine") -> None:
        """Return to the state of ``before``, an earlier copy of this MotorLine."""
        self.__dict__.update(before.__dict__)

    def rescale(self, factor: float) -> None:
        """Convert what was learned to new nominal units: multiply all speeds by ``factor``."""
        if self._learned and factor != 1.0:
            self._ss, self._so, self._oo = (
                each * factor * factor for each in (self._ss, self._so, self._oo)
            )
            self._set(self.slope * factor, self.offset * factor)

    def _set(self, slope: float, offset: float) -> None:
        self.slope = min(HIGHEST_SLOPE, max(LOWEST_SLOPE, slope))
        self.offset = min(0.0, max(-MOST_DEAD * self.slope, offset))

    def speed(self, units: float) -> float:
        """Return the motor's speed, in nominal units, for the motor units ``units``.

        The value is negative if ``units`` are too few for the motor to turn.
        """
        return self.slope * units + self.offset

    def units(self, speed: float) -> float:
        """Return the motor units for ``speed``, which is positive and in nominal units."""
        return (speed - self.offset) / self.slope
