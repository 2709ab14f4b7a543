# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The IMU: its gyro, whether the IMU works, and the heading that the server computes from the gyro.

This module does not know motions or commands.
"""

from omnibot_driver.simulator.mart.settings import MartSettings


class Imu:
    """The gyro, and the values that the server computes from it.

    * ``alive``: whether the IMU is plugged in, as set by the caller. ``MartSettings.imu_dies_s``
      does not change this value.
    * ``closed``: whether the server has stopped using the IMU (until RST IMU or SB succeeds).
    * ``rate_dps``: last turn rate in degrees/s, minus the bias that the server knows.
    * ``heading_deg``: the relative heading in degrees, positive to the left.
    """

    def __init__(self, settings: MartSettings) -> None:
        self._dies_s, self._returns_s = settings.imu_dies_s, settings.imu_returns_s
        self._bias_dps = settings.gyro_bias_dps
        self.alive = True
        self._since_s = 0.0
        self.restart()

    def restart(self) -> None:
        """Reset the known bias, the heading and the rate, as at the start of the server."""
        self._known_dps = 0.0
        self.closed = False
        self.heading_deg = 0.0
        self.rate_dps = 0.0

    def copy(self) -> "Imu":
        """Return an independent copy."""
        new = Imu.__new__(Imu)
        new.__dict__.update(self.__dict__)
        return new

    def plugged(self, now: float) -> bool:
        """Return whether the IMU answers on its bus."""
        return self.alive and not self._dies_s <= now < self._returns_s

    def living(self, now: float) -> bool:
        """Return whether the server receives samples of the IMU."""
        return self.alive and not self.closed and not self._dies_s <= now < self._returns_s

    def learn(self) -> None:
        """Give the server the current bias, as if it had measured the bias at rest."""
        self._known_dps = self._bias_dps

    def sample(self, rate_dps: float, now: float, *, integrates: bool) -> None:
        """Take a sample of the turn rate.

        ``integrates``: whether the heading changes too, by the rate times the time since the
        previous sample.
        """
        self.rate_dps = rate = rate_dps + self._bias_dps - self._known_dps
        if integrates:
            self.heading_deg += rate * (now - self._since_s)
        self._since_s = now

    def drift(self, now: float, *, integrates: bool) -> None:
        """Advance to ``now``. The robot has been at rest since the previous sample.

        ``integrates``: whether the heading changes in this time. The rate of change is the gyro's
        bias minus the bias that the server knows.
        """
        if integrates and self.living(now):
            self.heading_deg += (self._bias_dps - self._known_dps) * (now - self._since_s)
        self._since_s = now
