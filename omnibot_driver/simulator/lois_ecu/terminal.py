# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The terminal mode: characters that pass between the board's sensors and the host.

This module knows characters and their sensors. It does not know the protocol.
"""

from collections import deque

from omnibot_driver.simulator.lois_ecu.settings import Quirks
from omnibot_driver.simulator.lois_ecu.uart import BYTES_PER_STEP

GPS, COMPASS = 1, 2
NO_TERMINAL = (0, 4)
PASSED_ON_DEPTH = 2048
CHARACTERS_PER_STEP = {GPS: 0.96, COMPASS: 0.48}
"""Number of characters that a sensor's serial line carries in 1 ms: the GPS at 9600 baud, the
compass at 4800 baud."""


class Terminal:
    """State of the terminal mode. ``mode``: the value that the host wrote last."""

    def __init__(self, quirks: Quirks) -> None:
        self._quirks = quirks
        self.mode = 0
        self._to_sensor = 0.0
        self._waiting: dict[int, deque[int]] = {GPS: deque(), COMPASS: deque()}

    @property
    def on(self) -> bool:
        """Whether the board is in a terminal mode.

        In a terminal mode, the board sends data of its sensors, and no periodic messages or
        records.
        """
        return self.mode not in NO_TERMINAL

    @property
    def busy(self) -> bool:
        """Whether the main loop waits because characters are being sent to the sensor."""
        return self._to_sensor > 0

    def heard(self, count: int) -> None:
        """Record that ``count`` characters came from the host.

        In a terminal mode, the public firmware forwards characters from the host to the sensor.
        """
        if self.on and self._quirks.terminal_passes_input_on:
            self._to_sensor = min(self._to_sensor + count, PASSED_ON_DEPTH)

    def sensor(self, sensor: int, text: bytes) -> bytes:
        """Process text from a sensor. Return the text that the board sends to the host now.

        With the quirk ``terminal_mixes_sensors``, this method returns nothing, and ``mixed``
        returns the text later.
        """
        if not self._quirks.terminal_mixes_sensors:
            return text if self.mode == sensor else b""
        if self.on:
            self._waiting[sensor].extend(text)
        return b""

    def mixed(self) -> bytes:
        """Advance by 1 ms. Return the next character of each sensor, or b"" while ``busy``."""
        if self.busy:
            speed = CHARACTERS_PER_STEP.get(self.mode, BYTES_PER_STEP)
            self._to_sensor = max(self._to_sensor - speed, 0.0)
            return b""
        if not any(self._waiting.values()):
            return b""
        mixed = bytes(waiting.popleft() for waiting in self._waiting.values() if waiting)
        return mixed if self.on else b""
