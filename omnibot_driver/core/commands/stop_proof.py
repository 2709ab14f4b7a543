# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Whether the robot is known to stand still since it was last told to.

A stop is not acknowledged, but displacements show it. Knows displacements and when Stop and motion
went out; not what is done while the proof is missing. Time is an argument.
"""

import math
from typing import Final

from omnibot_driver.core.readings import DisplacementReading

STILL_MPS: Final = 0.01
STILL_RADPS: Final = 0.03
"""Above two encoder counts of a wheel in 40 ms, below the slowest linear command (0.014 m/s)."""
STILL_S: Final = 0.1
"""Three displacements of 40 ms."""
SLACK_S: Final = 1e-6
"""Three times 0.2 s are a little less than 0.6 s in floating point."""
AT_LEAST: Final = 2
"""Displacements, where one is as long: one alone may be damaged, or be from before the wheels
turned."""
PROOFS: Final = 2.0
"""Factor on the time in which a standstill has to be seen."""
RAREST_S: Final = 1.0
"""A longer displacement is that of a gap."""
UNDER_WAY_S: Final = 0.05
"""A displacement that arrives so soon after Stop went out may have ended before Stop arrived."""


class StopProof:
    """``proved``: Stop went out, no motion since, and the robot has stood for ``still_s``.

    ``owed``: motion went out, and since then nothing has proved that the robot stands.
    ``measured``: a displacement has come since Stop went out.
    """

    def __init__(self, still_s: float = STILL_S) -> None:
        self._needed_s = still_s - SLACK_S
        self._period_s = 0.0
        self.owed = False
        self.begin()

    def begin(self) -> None:
        """Start a proof: nothing is known of the robot's motion yet."""
        self.proved = self.measured = False
        self._stopped_at = math.inf
        self._still_s, self._still = 0.0, 0

    def moved(self) -> None:
        """Note that a command to move was sent."""
        self.begin()
        self.owed = True

    def stopped(self, now: float) -> None:
        """Stop went out."""
        self._stopped_at = min(self._stopped_at, now)

    def paused(self) -> None:
        """Note that the board is paused: its motors are off."""
        self.proved, self.owed = True, False

    @property
    def takes_s(self) -> float:
        """The time to wait for a proof, given the period of the displacements."""
        return max(PROOFS * self._needed_s, UNDER_WAY_S + (AT_LEAST + 1) * self._period_s)

    def look(self, reading: DisplacementReading, now: float) -> None:
        """Look at a displacement."""
        self._period_s = min(reading.duration_s or 0.0, RAREST_S)
        if not reading.duration_s or not reading.measured or now < self._stopped_at + UNDER_WAY_S:
            return
        self.measured = True
        moves = (
            math.hypot(reading.dx_m, reading.dy_m) > STILL_MPS * reading.duration_s
            or abs(reading.dyaw_rad) > STILL_RADPS * reading.duration_s
        )
        self._still_s = 0.0 if moves else self._still_s + reading.duration_s
        self._still = 0 if moves else self._still + 1
        self.proved = self._still_s >= self._needed_s and self._still >= AT_LEAST
        self.owed = self.owed and not self.proved
