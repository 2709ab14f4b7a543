# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The gyro, whether it lives, and what the server makes of it.

Knows turn rates and times. Must not know motions or commands.
"""

from omnibot_driver.simulator.mart.settings import MartSettings


class Imu:
    """``alive``: set it to unplug the IMU or to plug it in again; option times come on top.

    closed: the server gave it up, and tries again only with RST IMU or SB. rate_dps: of the last
    sample, less the bias that the server knows. heading_deg: the relative angle, left positive.
    """

    def __init__(self, settings: MartSettings) -> None:
        self._dies_s, self._returns_s = settings.imu_dies_s, settings.imu_returns_s
        self._bias_dps = settings.gyro_bias_dps
        self.alive = True
        self._since_s = 0.0
        self.restart()

    def restart(self) -> None:
        """The server begins anew."""
        self._known_dps = 0.0
        self.closed = False
        self.heading_deg = 0.0
        self.rate_dps = 0.0

    def copy(self) -> "Imu":
        """An independent one."""
        new = Imu.__new__(Imu)
        new.__dict__.update(self.__dict__)
        return new

    def plugged(self, now: float) -> bool:
        """Whether it answers on its bus."""
        return self.alive and not self._dies_s <= now < self._returns_s

    def living(self, now: float) -> bool:
        """Whether the server gets samples."""
        return self.alive and not self.closed and not self._dies_s <= now < self._returns_s

    def learn(self) -> None:
        """Take the bias of a robot at rest."""
        self._known_dps = self._bias_dps

    def sample(self, rate_dps: float, now: float, *, integrates: bool) -> None:
        """The robot turned at this rate since the last sample."""
        self.rate_dps = rate = rate_dps + self._bias_dps - self._known_dps
        if integrates:
            self.heading_deg += rate * (now - self._since_s)
        self._since_s = now

    def drift(self, now: float, *, integrates: bool) -> None:
        """The robot has stood since the last sample."""
        if integrates and self.living(now):
            self.heading_deg += (self._bias_dps - self._known_dps) * (now - self._since_s)
        self._since_s = now
