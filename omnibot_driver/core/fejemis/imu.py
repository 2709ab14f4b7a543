# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Computes when the board took each sample of its IMU, and converts the sample to SI units.

The board's lines carry no sampling time, but the board takes a sample every 10 ms. So each sampling
time is the *phase*, a constant time, plus a whole number of periods. The phase follows from the
arrival times of the samples.

Input: pairs of a gyro line and an acceleration line, formed by ``imu_pairs.py``.
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
"""Limit of the time between the arrivals of two successive samples, in periods.

The driver uses the limit only if both samples seem to be late by about a period or more. If the
time between the arrivals is above the limit, the samples are not late: an earlier sample was lost.
If the time is below the limit, both samples have waited because the host stalled, and no sample was
lost.
"""
CYCLE_S: Final = 0.0015
"""Longest time in s that the board is assumed to need to send all lines of one control cycle."""
PHASE_BLOCKS: Final = 3
BLOCK: Final = 100


class ImuSamples:
    """Converter of IMU samples to readings, and of their arrival times to sampling times.

    ``unit``: unit in which the board sends accelerations.

    ``rates``, ``forces``: the last sample in rad/s and in m/s²; NaN before the first.
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
        self._block_s, self._block_from = math.inf, 0
        self._delay_s = 0.0

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
        """Return when the board took the next sample, in s of the board's clock.

        ``arrived_s``: when the sample arrived, by that clock.

        ``not_before_s``: time of the last pose before the sample.

        ``next_pose_s``: time of the pose that arrived next; infinity if none has arrived yet.

        ``skipped``: how many incomplete samples were left out since the previous sample.
        """
        if self._phase_s is None or arrived_s - self._phase_s < -1.0:
            self.begin()
            self._phase_s = self._arrived_s = arrived_s
            return arrived_s
        since_s, self._arrived_s = arrived_s - self._arrived_s, arrived_s
        self._count += 1 + skipped
        time_s = self._phase_s + self._count * PERIOD_S
        # A sample that arrives after a pose is not older than the pose.
        lost = math.ceil(max(0.0, (not_before_s - CYCLE_S - time_s) / PERIOD_S))
        delay_s = arrived_s - time_s - lost * PERIOD_S
        waited = arrived_s > next_pose_s + PERIOD_S  # sample and pose were read late
        if delay_s < -PERIOD_S / 2:
            lost += (more := round(delay_s / PERIOD_S))
            delay_s -= more * PERIOD_S
        elif since_s > REGULAR * PERIOD_S and min(delay_s, self._delay_s) > LATE * PERIOD_S:
            more = 0 if waited else int(min(delay_s, self._delay_s) / PERIOD_S + 1.0 - LATE)
            lost += more
            delay_s -= more * PERIOD_S
        self._delay_s = 0.0 if waited else delay_s
        self._count += lost
        self._follow(delay_s)
        return self._phase_s + self._count * PERIOD_S

    def _follow(self, delay_s: float) -> None:
        """Set the phase of the sampling times, after a sample that arrived ``delay_s`` late.

        The new phase is the latest one with which no recent sample arrives before its sampling
        time. The recent samples are the last three blocks of 100 samples, and all samples after
        these blocks.
        """
        assert self._phase_s is not None
        self._block_s = min(self._block_s, delay_s + self._phase_s)
        if self._block_s < self._phase_s:
            self._phase_s = self._block_s
        if self._count - self._block_from >= BLOCK:
            self._floor_s.append(self._block_s)
            self._phase_s = min(self._floor_s)
            self._block_s, self._block_from = math.inf, self._count
