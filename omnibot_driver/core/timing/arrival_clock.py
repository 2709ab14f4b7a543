# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A clock for boards whose readings carry no time and have no regular tick.

``ArrivalClock`` has the methods of ``DeviceClock``. The caller passes the time.
"""

import math
from collections.abc import Sequence
from typing import Final

from omnibot_driver.core.readings import ImuReading, Reading, SampleBoundary

SMALLEST_STEP_S: Final = 1e-6
"""Step in s between the stamps of two readings that arrived in the same read."""


class ArrivalClock:
    """Stamps readings with their arrival time. Each stamp is later than the stamp before it.

    A stamp is later than the arrival time only if two reads came almost at the same time.
    """

    skew_ppm = 0.0

    def __init__(self) -> None:
        self._stamp_s = -math.inf

    def restart(self) -> None:
        """Do nothing: stamps depend only on arrival times, and continue to increase."""

    def stamps(
        self, readings: Sequence[Reading], now: float, edge: SampleBoundary | None
    ) -> list[float]:
        """Return the stamp of each reading in s, each later than the stamp before it."""
        stamps = []
        for left in range(len(readings) - 1, -1, -1):
            at_s = now - left * SMALLEST_STEP_S
            self._stamp_s = max(at_s, self._stamp_s + SMALLEST_STEP_S)
            stamps.append(self._stamp_s)
        return stamps

    def stamp(self, reading: ImuReading, now: float, edge: SampleBoundary | None) -> float | None:
        """Return the stamp of one reading in s, later than the stamp before it."""
        return self.stamps((reading,), now, edge)[0]
