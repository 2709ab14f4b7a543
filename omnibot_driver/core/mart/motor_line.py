# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The speed of two motors over their units, as a straight line that is learned.

A motor without a regulator needs some units before it turns, so its speed is not in proportion to
them: a gain that was learned while driving makes a slow turn on the spot too slow. Speeds are given
in nominal units, those that an ideal motor would need. Knows nothing of wheels or time.
"""

from typing import Final

LOWEST_SLOPE, HIGHEST_SLOPE = 0.4, 2.5
MOST_DEAD: Final = 20.0
"""Units that a motor needs before it turns, at most."""
SLOPE_SD, OFFSET_SD = 0.3, 4.0
"""What is known before anything is measured: slope 1, offset 0."""
SLOPE_DRIFT, OFFSET_DRIFT = 0.01, 0.2
"""Standard deviations of the change from one measurement to the next."""
NOISE, NOISE_PART = 0.3, 0.02
"""Of a measurement: in units, and as a part of it."""


class MotorLine:
    """``slope * units + offset`` is the speed in nominal units; a Kalman filter of both."""

    def __init__(self) -> None:
        self.slope, self.offset = 1.0, 0.0
        self._ss, self._so, self._oo = SLOPE_SD**2, 0.0, OFFSET_SD**2

    def learn(self, units: float, speed: float, doubt: float = 1.0) -> None:
        """These units made this speed; ``doubt`` multiplies the error that it may have."""
        self._ss += SLOPE_DRIFT**2
        self._oo += OFFSET_DRIFT**2
        to_slope = self._ss * units + self._so
        to_offset = self._so * units + self._oo
        noise = (NOISE + NOISE_PART * units) * doubt
        variance = to_slope * units + to_offset + noise * noise
        error = speed - (self.slope * units + self.offset)
        slope = self.slope + to_slope / variance * error
        offset = self.offset + to_offset / variance * error
        self._ss -= to_slope * to_slope / variance
        self._so -= to_slope * to_offset / variance
        self._oo -= to_offset * to_offset / variance
        self.slope = min(HIGHEST_SLOPE, max(LOWEST_SLOPE, slope))
        self.offset = min(0.0, max(-MOST_DEAD * self.slope, offset))

    def units(self, speed: float) -> float:
        """What this speed, which is positive, needs."""
        return (speed - self.offset) / self.slope
