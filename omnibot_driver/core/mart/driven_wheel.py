# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""One motor and the wheel that it turns: motor units, and measurements in an averaging window.

This module knows units, metres and seconds; it does not know the other motor, or what is commanded.
"""

from dataclasses import dataclass
from typing import Final

from omnibot_driver.core.mart.motor_line import MOST_DEAD, MotorLine
from omnibot_driver.core.mart.motors import MOST_UNITS

SLOWEST_MPS: Final = 0.015
"""Measured wheel speed in m/s above which a wheel is regarded as turning."""


@dataclass(slots=True)
class DrivenWheel:
    """One motor, and the wheel that it turns.

    * ``stood_s``: time in s for which the wheel has not turned in spite of enough motor units.
    * ``window_units_s``: sum of units * seconds in the averaging window.
    * ``window_m``: distance in m in the averaging window.
    """

    line: MotorLine
    units: int = 0
    stood_s: float = 0.0
    window_units_s: float = 0.0
    window_m: float = 0.0

    def wanted_units(self, speed: float) -> int:
        """Return the units for ``speed`` (in nominal units); zero if ``speed`` is not positive."""
        return round(min(MOST_UNITS, max(0.0, self.line.units(speed)))) if speed > 0.0 else 0

    def change(self, more: int) -> int:
        """Change the units by ``more``, within their limits; return by how much they change."""
        before = self.units
        self.units = min(MOST_UNITS, max(0, before + more))
        return self.units - before

    def error(self, less: int, seconds: float, per_unit_mps: float) -> float:
        """Return measured minus expected speed, averaged over ``seconds``, in nominal units.

        ``less``: by how many units the motor's real units are below the assumed ones, after a lost
        command. ``per_unit_mps``: speed in m/s of an ideal motor with one unit.
        """
        expected = self.line.speed(self.window_units_s / seconds - less)
        return self.window_m / seconds / per_unit_mps - max(0.0, expected)

    def learn(self, seconds: float, per_unit_mps: float, doubt: float) -> None:
        """Learn from the averaging window, which lasts ``seconds``, how fast the motor turns.

        ``per_unit_mps``: speed in m/s that an ideal motor has with one unit.

        ``doubt``: factor for the assumed standard deviation of the measured speed.
        """
        units = self.window_units_s / seconds
        speed = self.window_m / seconds / per_unit_mps
        slowest = SLOWEST_MPS / per_unit_mps
        should_turn = units < MOST_DEAD and self.line.speed(units) > slowest
        must_turn = units >= MOST_DEAD and self.line.speed(units) > 2 * slowest
        self.stood_s = self.stood_s + seconds if must_turn and speed < slowest else 0.0
        if speed > slowest or should_turn:  # else nothing is learned from a wheel at rest
            self.line.learn(units, max(0.0, speed), doubt)
