# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The stop proof: whether displacements show that the robot stands still after the last Stop.

Boards do not acknowledge a stop. Time is an argument.
"""

import math
from typing import Final

from omnibot_driver.core.readings import DisplacementReading

STILL_MPS: Final = 0.01
STILL_RADPS: Final = 0.03
"""``STILL_MPS``, ``STILL_RADPS``: largest speeds in m/s and rad/s that count as standstill.

Two encoder counts in 40 ms are within these limits. The slowest command, 0.014 m/s, exceeds them.
"""
STILL_S: Final = 0.1
"""Default duration of standstill that proves a stop, in s.

Three displacements of 40 ms each last longer than this.
"""
SLACK_S: Final = 1e-6
"""Tolerance in s for rounding errors: as floats, ten times 0.1 s add up to less than 1 s."""
AT_LEAST: Final = 2
"""Smallest number of displacements in a proof.

A single displacement could be damaged, or come from the time before the wheels began to turn.
"""
PROOFS: Final = 2.0
"""Time limit for a proof of a stop, as a multiple of the standstill that is the proof.

If displacements are rare, the driver waits longer.
"""
RAREST_S: Final = 1.0
"""Upper limit, in s, for the assumed period of displacements.

The driver takes the period from the last displacement, whose duration may also cover lost ones.
"""
UNDER_WAY_S: Final = 0.05
"""Time after Stop in which displacements are ignored, in s. They may have been measured before Stop
arrived."""


class StopProof:
    """The proof that the robot stands still.

    * ``proved``: whether the robot is known to stand still.
    * ``owed``: whether a motion command was sent, and no standstill has been proved since.
    * ``measured``: whether a displacement arrived later than ``UNDER_WAY_S`` after Stop.
    """

    def __init__(self, still_s: float = STILL_S) -> None:
        self._needed_s = still_s - SLACK_S
        self._period_s = 0.0
        self.owed = False
        self.begin()

    def begin(self) -> None:
        """Discard the proof so far, because the robot's motion is unknown. Begin a new proof."""
        self.proved = self.measured = False
        self._stopped_at = math.inf
        self._still_s, self._still = 0.0, 0

    def moved(self) -> None:
        """Record that a command to move was sent."""
        self.begin()
        self.owed = True

    def stopped(self, now: float) -> None:
        """Record that Stop was sent."""
        self._stopped_at = min(self._stopped_at, now)

    def paused(self) -> None:
        """Record that the board is paused, which proves the standstill: its motors are off."""
        self.proved, self.owed = True, False

    @property
    def takes_s(self) -> float:
        """Time in s to wait for a proof. It depends on the period of the displacements."""
        return max(PROOFS * self._needed_s, UNDER_WAY_S + (AT_LEAST + 1) * self._period_s)

    def look(self, reading: DisplacementReading, now: float) -> None:
        """Update the proof with a displacement that arrived at ``now``."""
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
