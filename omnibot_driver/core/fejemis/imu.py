# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Computes the sampling time of each IMU sample, and converts the sample to SI units.

Each sampling time is a constant *phase*, found from arrival times, plus periods of 10 ms.
"""

import math
from collections import deque
from typing import Final

from omnibot_driver.core.fejemis.imu_pairs import PERIOD_S, Pair
from omnibot_driver.core.fejemis.settings import AccelerationUnit
from omnibot_driver.core.readings import ImuReading, Vector3

STANDARD_GRAVITY: Final = 9.80665
LATE: Final = 0.98
REGULAR: Final = 0.6
"""Limit, in sampling periods, for the time between the arrivals of two successive late samples.

Above this limit, a sample was lost before the two samples. Below this limit, the two samples are
late because the host has stalled.
"""
CYCLE_S: Final = 0.0015
"""Longest time in s that the board is assumed to need to send all lines of one control cycle."""
PHASE_BLOCKS: Final = 3
BLOCK: Final = 100
BLOCK_S: Final = 0.5
"""Shortest time in s in which the samples of a block arrive. A shorter block could consist only of
late samples, which arrive together after a stall.
"""
EARLY_S: Final = 5e-4
"""Longest time in s by which a sample may seem to arrive before its sampling time. If a sample
seems to arrive even earlier, the driver has assumed too many lost samples before it.
"""


class ImuSamples:
    """Converter of IMU samples to readings, and of their arrival times to sampling times.

    * ``unit``: unit in which the board sends accelerations.
    * ``rates``, ``forces``: last sample, in rad/s and m/s²; NaN before the first.
    """

    def __init__(self, unit: AccelerationUnit) -> None:
        self.unit: AccelerationUnit = unit
        self.begin()

    def begin(self) -> None:
        """Forget the last sample and the phase of the sampling times.

        The caller calls this method when the board's streams start again.
        """
        self.rates: Vector3 = (math.nan,) * 3
        self.forces: Vector3 = (math.nan,) * 3
        self._count = 0
        self._arrived_s = -math.inf
        self._phase_s: float | None = None
        self._floor_s: deque[float] = deque(maxlen=PHASE_BLOCKS)
        self._block_s, self._block_from, self._block_at_s = math.inf, 0, 0.0
        self._delay_s = 0.0
        self._guessed = 0
        """Number of samples that are counted as lost, but may only be late. Later samples decide.
        """

    def reading(self, pair: Pair) -> ImuReading:
        """Convert a pair of lines to a reading in SI units."""
        gyro, acceleration = pair.gyro, pair.acceleration
        scale = STANDARD_GRAVITY if self.unit == "g" else 1.0
        self.rates = math.radians(gyro.x), math.radians(gyro.y), math.radians(gyro.z)
        self.forces = (scale * acceleration.x, scale * acceleration.y, scale * acceleration.z)
        return ImuReading(self.forces, self.rates)

    def sampled_s(
        self, arrived_s: float, not_before_s: float, next_pose_s: float, skipped: int
    ) -> float:
        """Return when the board took the next sample. All times are in s of the board's clock.

        * ``not_before_s``: time of the pose before the sample.
        * ``next_pose_s``: time of the pose after the sample; infinity if this pose has not arrived.
        * ``skipped``: number of incomplete samples since the previous sample.
        """
        if self._phase_s is None or arrived_s - self._phase_s < -1.0:
            self.begin()
            self._phase_s = self._arrived_s = self._block_at_s = arrived_s
            return arrived_s
        since_s, self._arrived_s = arrived_s - self._arrived_s, arrived_s
        self._count += 1 + skipped
        time_s = self._phase_s + self._count * PERIOD_S
        # A sample that arrives after a pose is not older than the pose.
        lost = math.ceil(max(0.0, (not_before_s - CYCLE_S - time_s) / PERIOD_S))
        delay_s = arrived_s - time_s - lost * PERIOD_S
        waited = arrived_s > next_pose_s + PERIOD_S  # sample and pose were read late
        if self._floor_s and self._guessed and delay_s < -EARLY_S:
            less = min(self._guessed, math.ceil((-EARLY_S - delay_s) / PERIOD_S))
            lost -= less
            delay_s += less * PERIOD_S
            self._guessed -= less
        elif delay_s < EARLY_S:
            self._guessed = 0
        if delay_s < -PERIOD_S / 2:
            lost += (more := round(delay_s / PERIOD_S))
            delay_s -= more * PERIOD_S
        elif since_s > REGULAR * PERIOD_S and min(delay_s, self._delay_s) > LATE * PERIOD_S:
            more = 0 if waited else int(min(delay_s, self._delay_s) / PERIOD_S + 1.0 - LATE)
            lost += more
            self._guessed += more
            delay_s -= more * PERIOD_S
        self._delay_s = 0.0 if waited else delay_s
        self._count += lost
        self._follow(delay_s)
        return self._phase_s + self._count * PERIOD_S

    def _follow(self, delay_s: float) -> None:
        """Update the phase of the sampling times: no recent sample may arrive before its time.

        ``delay_s``: time in s from the sampling to the arrival of the new sample, by the old phase.
        """
        assert self._phase_s is not None
        self._block_s = min(self._block_s, delay_s + self._phase_s)
        if self._block_s < self._phase_s:
            self._phase_s = self._block_s
        lasted_s = self._arrived_s - self._block_at_s
        if self._count - self._block_from >= BLOCK and lasted_s >= BLOCK_S:
            self._floor_s.append(self._block_s)
            self._phase_s = min(self._floor_s)
            self._block_s, self._block_from = math.inf, self._count
            self._block_at_s = self._arrived_s
