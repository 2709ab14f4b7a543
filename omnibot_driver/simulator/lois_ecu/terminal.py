# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What passes between the board's sensors and its host in a terminal mode.

Knows characters and which sensor wrote them; must not know the protocol, nor when it sends.
"""

from collections import deque

from omnibot_driver.simulator.lois_ecu.settings import Quirks
from omnibot_driver.simulator.lois_ecu.uart import BYTES_PER_STEP

GPS, COMPASS = 1, 2
NO_TERMINAL = (0, 4)
PASSED_ON_DEPTH = 2048
CHARACTERS_PER_STEP = {GPS: 0.96, COMPASS: 0.48}
"""At 9600 and 4800 baud."""


class Terminal:
    """``mode``: as the host wrote it last."""

    def __init__(self, quirks: Quirks) -> None:
        self._quirks = quirks
        self.mode = 0
        self._to_sensor = 0.0
        self._waiting: dict[int, deque[int]] = {GPS: deque(), COMPASS: deque()}

    @property
    def on(self) -> bool:
        """Whether the board itself is silent."""
        return self.mode not in NO_TERMINAL

    @property
    def busy(self) -> bool:
        """Whether the main loop waits for characters that go to the sensor."""
        return self._to_sensor > 0

    def heard(self, count: int) -> None:
        """This many characters came from the host; they go to the sensor."""
        if self.on and self._quirks.terminal_passes_input_on:
            self._to_sensor = min(self._to_sensor + count, PASSED_ON_DEPTH)

    def sensor(self, sensor: int, text: bytes) -> bytes:
        """A sensor has written this; what of it goes to the host at once."""
        if not self._quirks.terminal_mixes_sensors:
            return text if self.mode == sensor else b""
        if self.on:
            self._waiting[sensor].extend(text)
        return b""

    def mixed(self) -> bytes:
        """One step: a character of each sensor that has some, where the board is free for it."""
        if self.busy:
            speed = CHARACTERS_PER_STEP.get(self.mode, BYTES_PER_STEP)
            self._to_sensor = max(self._to_sensor - speed, 0.0)
            return b""
        mixed = bytes(waiting.popleft() for waiting in self._waiting.values() if waiting)
        return mixed if self.on else b""
