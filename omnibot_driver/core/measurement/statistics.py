# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Statistics of the received readings: counts, losses and delays.

This module knows readings and times; it does not judge them.
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
    """Counts and sums since the driver began.

    All counts only grow, except ``last_gap``, ``same_force`` and ``same_rate``.

    * ``imu_period_s``: period of the IMU in s, for counting lost readings; None if the IMU readings
      themselves report losses (``lost``).
    """

    imu_period_s: float | None = None
    imu: int = 0
    displacements: int = 0
    poses: int = 0
    restarts: int = 0
    lost_imu: int = 0
    lost_displacements: int = 0
    gaps: int = 0
    """Number of gaps. In each gap, one displacement or several in a row were lost."""
    last_gap: int = 0
    """Number of displacements that were lost in the last gap."""
    reads: int = 0
    """Number of reads whose last reading was an IMU sample or a displacement."""
    delay_s: float = 0.0
    """Sum of delays in s: for each of the ``reads``, the age of its newest sample.

    An age can be a few microseconds below 0, because a stamp can be later than the read.
    """
    squared_delay_s2: float = 0.0
    same_force: int = 0
    same_rate: int = 0
    """``same_force``, ``same_rate``: how many times in a row the accelerometer and the gyro have
    repeated exactly the same values."""
    _force: Vector3 | None = field(default=None, repr=False)
    _rate: Vector3 | None = field(default=None, repr=False)
    _sent_imu: int | None = field(default=None, repr=False)
    """Number of IMU readings that the board had sent before the last displacement; None if unknown.

    When a pose shows lost displacements, the IMU readings of the same time are added.
    """
    _imus_per_displacement: int = field(default=0, repr=False)
    _restarted: bool = field(default=False, repr=False)
    """Whether a displacement since the last pose has shown a restart.

    If the next pose also shows a restart, it shows the same restart, which counts only once.
    """

    def read(self, readings: Sequence[Reading], delay_s: float) -> None:
        """Count the readings of one read. ``delay_s``: age of its newest sample, in s.

        The sum of delays contains only ages of IMU samples and displacements.
        """
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
                restarted = reading.restarted and not reading.doubtful
                self._miss(reading.lost, restarted)
                self._restarted |= restarted
                self._miss_imus(reading)
            elif isinstance(reading, PoseReading):
                self.poses += 1
                self._miss(reading.lost, reading.restarted and not self._restarted)
                self._restarted = False
                if self._sent_imu is not None:  # the next displacement does not count these
                    self._sent_imu += reading.lost * self._imus_per_displacement
            else:
                self.same_force = self.same_rate = 0
                self._sent_imu = None

    def _miss_imus(self, reading: DisplacementReading) -> None:
        """Count lost IMU readings: those that are missing between two displacements."""
        if self.imu_period_s is None:
            return
        if reading.duration_s is None or reading.restarted:
            self._sent_imu = None
        else:
            self._imus_per_displacement = round(reading.duration_s / self.imu_period_s)
        seen = self.imu + self.lost_imu
        if self._sent_imu is not None:
            sent = self._sent_imu + self._imus_per_displacement * (reading.lost + 1)
            self.lost_imu += max(0, sent - seen)
        self._sent_imu = self.imu + self.lost_imu

    def _miss(self, lost: int, restarted: bool) -> None:
        self.restarts += restarted
        if lost:
            self.lost_displacements += lost
            self.gaps += 1
            self.last_gap = lost
