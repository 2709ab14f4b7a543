# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What came in, in figures: counts that only grow. Knows readings and times, not what to make of
them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from omnibot_driver.core.readings import (
    DisplacementReading,
    ImuReading,
    PoseReading,
    Reading,
    Vector3,
)


@dataclass(slots=True)
class StreamStatistics:
    """Since the driver began; nothing but ``last_gap`` and the two of the sensor ever shrinks."""

    imu: int = 0
    displacements: int = 0
    poses: int = 0
    restarts: int = 0
    lost_imu: int = 0
    lost_displacements: int = 0
    gaps: int = 0
    """Stretches of lost displacements."""
    last_gap: int = 0
    """How many the last one lost."""
    reads: int = 0
    """That ended with a sample."""
    delay_s: float = 0.0
    """Sum over the reads of how old the newest sample was; the least that ever happens is 0."""
    squared_delay_s2: float = 0.0
    same_force: int = 0
    same_rate: int = 0
    """How often in a row each sensor has said exactly the same."""
    _force: Vector3 | None = field(default=None, repr=False)
    _rate: Vector3 | None = field(default=None, repr=False)

    def read(self, readings: Sequence[Reading], delay_s: float) -> None:
        """Count the readings of one read, and the age of its newest sample."""
        if isinstance(readings[-1], (ImuReading, DisplacementReading)):
            self.reads += 1
            self.delay_s += delay_s
            self.squared_delay_s2 += delay_s * delay_s
        for reading in readings:
            if isinstance(reading, ImuReading):
                force, rate = reading.specific_force, reading.angular_velocity
                self.imu += 1
                self.lost_imu += reading.lost
                self.same_force = self.same_force + 1 if force == self._force else 0
                self.same_rate = self.same_rate + 1 if rate == self._rate else 0
                self._force, self._rate = force, rate
            elif isinstance(reading, DisplacementReading):
                self.displacements += 1
                self._miss(reading.lost, reading.restarted)
            elif isinstance(reading, PoseReading):
                self.poses += 1
                self._miss(reading.lost, reading.restarted)
            else:
                self.same_force = self.same_rate = 0

    def _miss(self, lost: int, restarted: bool) -> None:
        self.restarts += restarted
        if lost:
            self.lost_displacements += lost
            self.gaps += 1
            self.last_gap = lost
