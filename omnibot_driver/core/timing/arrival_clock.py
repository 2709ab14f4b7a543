# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Stamps for boards whose readings carry no time and keep no tick: when they came in.

It offers what `device_clock.py` does. It reads no clock.
"""

import math
from collections.abc import Sequence
from typing import Final

from omnibot_driver.core.readings import ImuReading, Reading, SampleBoundary

SMALLEST_STEP_S: Final = 1e-6
"""Between two stamps of readings that came together."""


class ArrivalClock:
    """A stamp is never later than the arrival, except where the one before it was not earlier."""

    skew_ppm = 0.0

    def __init__(self) -> None:
        self._stamp_s = -math.inf

    def restart(self) -> None:
        """Begin a new line; stamps still increase."""

    def stamps(
        self, readings: Sequence[Reading], now: float, edge: SampleBoundary | None
    ) -> list[float]:
        """Stamps in the order of the readings, each later than the one before."""
        stamps = []
        for left in range(len(readings) - 1, -1, -1):
            at_s = now - left * SMALLEST_STEP_S
            self._stamp_s = max(at_s, self._stamp_s + SMALLEST_STEP_S)
            stamps.append(self._stamp_s)
        return stamps

    def stamp(self, reading: ImuReading, now: float, edge: SampleBoundary | None) -> float | None:
        """The stamp of one reading, as ``stamps`` gives it."""
        return self.stamps((reading,), now, edge)[0]
