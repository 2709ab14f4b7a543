# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Records of tick times, torques and headings. A record is sampled, then encoded as lines.

This module does not know when the lines are sent.
"""

from omnibot_driver.simulator.lois_ecu import wire
from omnibot_driver.simulator.lois_ecu.channel import RECORD_DEPTH, WheelChannel
from omnibot_driver.simulator.lois_ecu.settings import Quirks

RPM, TORQUE, HEADINGS = 0x04, 0x17, 0x0C
PADDING, HEADING_PADDING = 10, 0x016A


class Recorder:
    """Recorder of one record at a time.

    number: number of the command that requested the record in progress, or None.
    """

    def __init__(self, quirks: Quirks, wheels: tuple[WheelChannel, ...]) -> None:
        self._quirks, self._wheels = quirks, wheels
        self.number: int | None = None
        self._headings: list[int] = []
        self._wanted = 0

    def start(self, number: int, payload: int) -> None:
        """Start a record, and discard the previous record."""
        self.number = number
        if number == HEADINGS:
            self._headings, self._wanted = [], payload
            return
        for channel, samples in zip(self._wheels, (payload >> 16, payload & 0xFFFF), strict=True):
            channel.start_record(samples, torque=number == TORQUE)

    def control(self) -> None:
        """Take a torque sample if a torque record is running.

        The board calls this method at each step of the speed controllers.
        """
        if self.number == TORQUE:
            for channel in self._wheels:
                channel.torque()

    def heading(self, heading: int) -> bytes:
        """Record a heading in degrees. Return the encoded record if it is complete, else b""."""
        if self.number != HEADINGS:
            return b""
        full = len(self._headings) >= min(self._wanted, 2 * RECORD_DEPTH)
        if not full:
            self._headings.append(heading)
            full = len(self._headings) >= self._wanted
            if self._quirks.record_waits_for_one_more:
                return b""
        if not full:
            return b""
        padded = self._headings + [HEADING_PADDING] * (len(self._headings) % 2)
        lines = [wire.words(HEADINGS, a, b) for a, b in zip(padded[::2], padded[1::2], strict=True)]
        self.number = None
        return b"".join([*lines, wire.words(HEADINGS, HEADING_PADDING, HEADING_PADDING)])

    def of_wheels(self) -> bytes:
        """Return the encoded record of both wheels if it is complete, else b""."""
        left, right = self._wheels
        if self.number not in (RPM, TORQUE) or left.record_left or right.record_left:
            return b""
        code = RPM if self._quirks.torque_comes_as_rpm else self.number
        pairs = max(len(left.record), len(right.record))
        lefts = left.record + [PADDING] * (pairs - len(left.record))
        rights = right.record + [PADDING] * (pairs - len(right.record))
        lines = [wire.words(code, a, b) for a, b in zip(lefts, rights, strict=True)]
        self.number = None
        return b"".join([*lines, wire.line(code, 0)])
