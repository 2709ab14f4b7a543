# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What the driver has learned about the two motors: how their speeds depend on the motor units.

Each motor has a ``MotorLine``. This module knows units, m/s and rad/s; it does not know what is
commanded.
"""

import copy
from typing import Final

from omnibot_driver.core.mart.motor_line import MotorLine
from omnibot_driver.core.mart.settings import MartSettings

MOST_UNITS: Final = 127
SLOWEST_TURN_RADPS: Final = 0.01
"""Smallest rate of a turn on the spot, in rad/s, from which the driver learns the motors'
speeds."""
UNEQUAL: Final = 0.04
"""Standard deviation of the ratio of the two motors' speeds at equal units."""
MOST_UNEQUAL: Final = 2 * UNEQUAL
"""Largest difference between the assumed ratio of the motors' speeds and ``motor_balance``."""
Lines = tuple[MotorLine, MotorLine]
BALANCE_UNITS: Final = 20
"""Smallest number of motor units for which the ratio of the two motors' speeds is computed. For
fewer units, the driver uses the more exact ratio at ``BALANCE_UNITS``."""


class Motors:
    """The right and the left motor.

    ``volts``: the battery voltage that the server last reported, in V.
    """

    def __init__(self, settings: MartSettings) -> None:
        self._settings = settings
        self.volts = settings.nominal_volts
        self._right_line, self._left_line = MotorLine(), MotorLine(settings.motor_balance)

    @property
    def settings(self) -> MartSettings:
        """The sizes and scales of the robot.

        When a parameter changes, the driver assigns new settings.
        """
        return self._settings

    @settings.setter
    def settings(self, settings: MartSettings) -> None:
        factor = _nominal_units_per_count(settings) / _nominal_units_per_count(self._settings)
        self._settings = settings
        for line in self._lines:
            line.rescale(factor)

    @property
    def per_unit_mps(self) -> float:
        """Speed in m/s that an ideal motor has with one unit, at the current battery voltage."""
        settings = self.settings
        return settings.speed_per_unit * self.volts / settings.nominal_volts

    def spin_units(self, rate_radps: float) -> int:
        """Return the motor units for a turn on the spot at this rate."""
        return _units(self._lines, self._spin_speed(rate_radps))

    def corrected_spin_units(self, units: int, seen_radps: float, rate_radps: float) -> int:
        """Return the motor units for a turn at ``rate_radps``, corrected by the measured rate.

        ``seen_radps``: rate measured with ``units`` in the present turn. What was learned about the
        motors stays unchanged.
        """
        lines = self.lines()
        _learn_spin(lines, units, self._spin_speed(seen_radps))
        return _units(lines, self._spin_speed(rate_radps))

    def spun(self, units: int, rate_radps: float) -> None:
        """Learn the motors' speeds from a turn on the spot in which both motors had ``units``.

        ``rate_radps``: mean rate of the turn.
        """
        if abs(rate_radps) > SLOWEST_TURN_RADPS:
            _learn_spin(self._lines, units, self._spin_speed(rate_radps))

    def lines(self) -> Lines:
        """Return a copy of what is learned about the right and the left motor, as MotorLines."""
        return copy.copy(self._right_line), copy.copy(self._left_line)

    def restore(self, lines: Lines) -> None:
        """Restore the two MotorLines that the method ``lines`` returned earlier.

        What the driver has learned about the motors since that call is forgotten.
        """
        for line, before in zip(self._lines, lines, strict=True):
            line.restore(before)

    @property
    def _lines(self) -> Lines:
        return self._right_line, self._left_line

    def _spin_speed(self, rate_radps: float) -> float:
        """Return each wheel's speed in a turn on the spot at ``rate_radps``, in nominal units."""
        return abs(rate_radps) * self._settings.track_m / 2 / self.per_unit_mps

    def _balance(self, units: float) -> float:
        """Return the ratio of the motors' speeds (left / right) when both are set to ``units``.

        The learned ratio is limited to ``motor_balance`` ± MOST_UNEQUAL, because it can be wrong.
        """
        usual, ratio = self._settings.motor_balance, self._line_ratio(units)
        return min(usual + MOST_UNEQUAL, max(usual - MOST_UNEQUAL, ratio))

    def _line_ratio(self, units: float) -> float:
        units = max(units, BALANCE_UNITS)
        return self._left_line.speed(units) / max(1.0, self._right_line.speed(units))

    def _ratio(self, right: int, left: int) -> float:
        """Return the expected ratio of left to right wheel speed at these motor units."""
        if not right:
            return 1.0
        equal = self._mean_speed(left) / max(1.0, self._mean_speed(right))
        return equal * self._balance(max(right, left))

    def _mean_speed(self, units: float) -> float:
        """Return the mean speed of both motors, in nominal units, at ``units`` motor units.

        The speed is at least 0.
        """
        return max(0.0, (self._right_line.speed(units) + self._left_line.speed(units)) / 2)

    def sides(self, speed_mps: float, rate_radps: float) -> tuple[float, float]:
        """Return the speeds of the right and the left wheel, in m/s, not negative.

        If the inner wheel would have to turn backward, its speed is 0.
        """
        half = rate_radps * self._settings.track_m / 2
        return max(0.0, speed_mps + half), max(0.0, speed_mps - half)


def _units(lines: Lines, speed: float) -> int:
    return max(2, min(MOST_UNITS, round(sum(line.units(speed) for line in lines) / 2)))


def _learn_spin(lines: Lines, units: int, speed: float) -> None:
    """Learn from a turn on the spot in which both motors had ``units``.

    ``speed``: the mean of both motors' speeds. Slope and offset change by the same amounts in both
    MotorLines.
    """
    right, left = lines
    error = speed - (right.speed(units) + left.speed(units)) / 2
    slope, offset = right.slope, right.offset
    right.learn(units, right.speed(units) + error)
    left.move(right.slope - slope, right.offset - offset)


def _nominal_units_per_count(settings: MartSettings) -> float:
    """Return the motor units that turn an ideal motor by one encoder count per second.

    The result is for a battery voltage of 1 V.
    """
    return abs(settings.metres_per_count) * settings.nominal_volts / settings.speed_per_unit
