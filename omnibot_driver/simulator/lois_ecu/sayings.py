# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The board's periodic messages as lines: GPS position, time, date, heading, ticks, odometry.

This module does not know when a message is sent.
"""

from omnibot_driver.simulator.lois_ecu import wire
from omnibot_driver.simulator.lois_ecu.channel import WheelChannel
from omnibot_driver.simulator.lois_ecu.odometry import DocumentedOdometry
from omnibot_driver.simulator.lois_ecu.sensors import Compass, Fix, fix_at
from omnibot_driver.simulator.lois_ecu.settings import LoisSettings
from omnibot_driver.simulator.lois_ecu.vehicle import Vehicle


class Sayings:
    """The periodic messages of one board, as lines. Each boot creates a new instance.

    ``began_s``: time of the boot, at which the board's clock in ns starts from zero.
    """

    def __init__(
        self,
        settings: LoisSettings,
        vehicle: Vehicle,
        wheels: tuple[WheelChannel, ...],
        odometry: DocumentedOdometry,
        compass: Compass,
        began_s: float,
    ) -> None:
        self._settings, self._vehicle, self._wheels = settings, vehicle, wheels
        self._odometry, self._compass = odometry, compass
        self._began_s = began_s

    def group(self, code: int, clock_ms: int, now_s: float) -> bytes:
        """Return the lines of the message with the command number ``code``."""
        quirks = self._settings.quirks
        if code == 0x10:
            return wire.words(code, 0, self._compass.last)
        if code in (0x0D, 0x0E, 0x0F):
            fix = self.fix(now_s)
            if code == 0x0D:
                place = (fix.latitude_deg, fix.longitude_deg)
                return wire.sequence(code, [wire.bits_of(number) for number in place])
            first, second, third = fix.time if code == 0x0E else fix.date
            return wire.line(code, first << 16 | second << 8 | third)
        odometry = self._odometry
        numbers = [wire.bits_of(n) for n in (*odometry.pose, *odometry.velocity)]
        if code == 0x20:
            return wire.sequence(code, numbers)
        clock = clock_ms if quirks.clock_in_ms else round((now_s - self._began_s) * 1e9)
        ticks = [channel.ticks & 0xFFFFFFFF for channel in self._wheels]
        group = wire.sequence(code, [clock & 0xFFFFFFFF, *ticks])
        return group + wire.sequence(code, numbers) if quirks.appends_odometry else group

    def fix(self, now_s: float) -> Fix:
        """Return the GPS fix at ``now_s``. Its values are zero if the firmware ignores the GPS."""
        settings, truth = self._settings, self._vehicle.truth
        if settings.quirks.gps_is_ignored:
            return Fix(0.0, 0.0, (0, 0, 0), (0, 0, 0))
        start = settings.start_latitude_deg, settings.start_longitude_deg
        return fix_at(start, truth.x_m, truth.y_m, settings.utc_s + now_s)
