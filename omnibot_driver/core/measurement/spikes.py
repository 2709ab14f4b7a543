# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Finds spikes in a series of readings, each of which is a list of values.

A spike is a single wrong reading: it leaps (changes implausibly much), and the next reading leaps
back. This module does not know what the values mean, or what happens to a reading that leaps.
"""

from collections.abc import Iterator, Sequence
from math import inf
from operator import sub
from typing import Final

OUT_OF_PROPORTION: Final = 3.0
"""Limit for a change between two readings, as a multiple of the largest recent change
(``_restless``). Only a larger change can be a spike."""
CALMING: Final = 0.95
"""Factor by which ``_restless``, the largest recent change, is reduced with each reading. After
20 readings, a third of it is left."""
END_OF_SCALE: Final = 0.99996
"""Fraction of the accelerometer's full scale. A reading of at least this fraction is regarded as
at the end of the scale. The largest positive reading of 16 bits is just above the fraction."""


class Spikes:
    """Finds spikes in a series of readings, each of which is a list of values.

    The values are scaled so that a change of 1 between two readings is always plausible.

    * ``left``: largest remaining change after a spike, as a fraction of the spike.
    * ``knocked``: number of values, from the beginning of the list, that a knock against the robot
      can change. A change of these values is a spike only if it looks like one flipped bit.
    """

    def __init__(self, left: float, *, knocked: int) -> None:
        self._left = left
        self._knocked = knocked
        self.forget()

    def forget(self) -> None:
        """Forget all readings until now, because the next ones are unrelated to them."""
        self._sure: Sequence[float] | None = None
        self._leaping: Sequence[float] | None = None
        self._restless = 0.0

    def judge(
        self, values: Sequence[float], periods: int = 1, topmost_bit: float = 0.0
    ) -> tuple[bool, bool]:
        """Return whether the last call's values were a spike, and whether the new values leap.

        Values leap if they change implausibly much. ``periods``: sampling periods since the
        previous values. ``topmost_bit``: value of an acceleration's highest bit, in the units of
        ``values``.
        """
        leaping, self._leaping = self._leaping, None
        was_single = False
        if leaping is not None and self._sure is not None:
            leapt = max(_steps(self._sure, leaping))
            was_single = max(_steps(self._sure, values)) <= self._left * leapt
            if was_single:  # from now on, only a larger leap may be a spike
                self._restless = max(self._restless, leapt / OUT_OF_PROPORTION)
            else:
                self._restless = max(self._restless, leapt)
                self._sure = leaping
        if self._sure is None:
            self._sure = values
            return False, False
        largest = max(_steps(self._sure, values))
        least = max(periods, OUT_OF_PROPORTION * self._restless)
        if largest > least:
            steps = list(_steps(self._sure, values))
            alone = sorted(steps)[-2] <= self._left * largest
            value = abs(values[steps.index(largest)])
            flipped = alone and self._is_a_bit(largest, value, topmost_bit)
            if flipped or max(steps[self._knocked :]) > least:
                self._leaping = values
                return was_single, True
        self._restless = max(CALMING * self._restless, largest)
        self._sure = values
        return was_single, False

    def _is_a_bit(self, step: float, value: float, topmost: float) -> bool:
        """Return whether one flipped bit can explain the change of a value.

        ``step``: size of the change. ``value``: magnitude after the change. At the end of the
        accelerometer's scale, the result is False.
        """
        if topmost == inf:  # the readings are not integers
            return False
        # the readings vary, so the change may differ from the value of a bit
        slack = OUT_OF_PROPORTION * self._restless
        # a knock against the robot can also bring the value to the end of the scale
        bit = topmost if value < END_OF_SCALE * topmost else 0.0
        while bit > step + slack:
            bit /= 2
        return abs(step - bit) <= slack


def _steps(before: Sequence[float], after: Sequence[float]) -> Iterator[float]:
    return map(abs, map(sub, after, before))
