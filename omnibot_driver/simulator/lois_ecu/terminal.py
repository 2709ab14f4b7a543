# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What passes between the board's sensors and its host in a terminal mode.

Knows characters and which sensor wrote them; must not know the protocol, nor when it sends.
"""

from collections import deque

from omnibot_driver.simulator.lois_ecu.settings import Quirks

GPS, COMPASS = 1, 2
NO_TERMINAL = (0, 4)


class Terminal:
    """``mode``: as the host wrote it last."""

    def __init__(self, quirks: Quirks) -> None:
        self._quirks = quirks
        self.mode = 0
        self._waiting: dict[int, deque[int]] = {GPS: deque(), COMPASS: deque()}

    @property
    def on(self) -> bool:
        """Whether the board itself is silent."""
        return self.mode not in NO_TERMINAL

    def sensor(self, sensor: int, text: bytes) -> bytes:
        """A sensor has written this; what of it goes to the host at once."""
        if not self._quirks.terminal_mixes_sensors:
            return text if self.mode == sensor else b""
        if self.on:
            self._waiting[sensor].extend(text)
        return b""

    def mixed(self) -> bytes:
        """One step: a character of each sensor that has some, for the host."""
        mixed = bytes(waiting.popleft() for waiting in self._waiting.values() if waiting)
        return mixed if self.on else b""
