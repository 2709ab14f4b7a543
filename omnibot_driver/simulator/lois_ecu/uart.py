# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The board's serial port at 115200 baud: the characters that it receives and sends.

The board can lose characters while it sends with interrupts off. This module does not know
messages.
"""

from collections import deque

BYTES_PER_STEP = 11.52
MOST_CREDIT = 2 * BYTES_PER_STEP
INPUT_DEPTH = 600


class Uart:
    """The serial port.

    * ``loses``: whether the board keeps only the first byte that arrives while interrupts are off.
    * ``input``: characters that were received but not read yet.
    """

    def __init__(self, *, loses: bool) -> None:
        self._loses = loses
        self.received = bytearray()
        self.lost_bytes = 0
        self._inbound: deque[int] = deque()
        self._in_credit = 0.0
        self.boot()

    def boot(self) -> None:
        """Clear the buffers. Bytes that are still on the line arrive later."""
        self.input: deque[int] = deque()
        self._sending: deque[tuple[bytearray, bool]] = deque()
        self._out_credit = 0.0
        self._kept: int | None = None
        self._misses = False

    @property
    def sending(self) -> bool:
        """Whether some data is still to be sent."""
        return bool(self._sending)

    @property
    def deaf(self) -> bool:
        """Whether the board is sending with interrupts off, so that received bytes may be lost."""
        return bool(self._sending) and self._sending[0][1]

    def receive(self, data: bytes) -> None:
        """Put bytes on the line. They arrive one after the other from now on."""
        self.received += data
        self._inbound.extend(data)

    def say(self, data: bytes, *, deaf: bool) -> None:
        """Queue data to be sent. ``deaf``: whether interrupts are off while the data is sent."""
        self._sending.append((bytearray(data), deaf))

    def miss(self) -> None:
        """Simulate an interrupt of 0.2 ms: the next ``listen`` loses its second character."""
        self._misses = True

    def listen(self) -> int:
        """Receive for one step of 1 ms. Return the number of characters received."""
        came = heard = 0
        credit = min(self._in_credit + BYTES_PER_STEP, MOST_CREDIT)
        hears = not (self._loses and self.deaf)
        while self._inbound and credit >= 1.0:
            credit -= 1.0
            byte = self._inbound.popleft()
            came += 1
            if self._misses and came == 2:
                self.lost_bytes += 1
            elif hears:
                self._hear(byte)
                heard += 1
            elif self._kept is None:
                self._kept = byte
            else:
                self.lost_bytes += 1
        self._in_credit = credit
        self._misses = False
        return heard

    def send(self, sent: bytearray) -> bool:
        """Send for one step of 1 ms, and append the sent bytes to ``sent``.

        Return True if this step completes data that the board sends with interrupts off. The caller
        must then call ``hear_kept``.
        """
        self._out_credit = min(self._out_credit + BYTES_PER_STEP, MOST_CREDIT)
        while self._sending and self._out_credit >= 1.0:
            burst, deaf = self._sending[0]
            count = min(int(self._out_credit), len(burst))
            sent += burst[:count]
            del burst[:count]
            self._out_credit -= count
            if not burst:
                self._sending.popleft()
                if deaf:
                    return True
        return False

    def hear_kept(self) -> int:
        """Receive the character that the hardware kept while interrupts were off.

        Return the number of characters received, 0 or 1.
        """
        if self._kept is None:
            return 0
        self._hear(self._kept)
        self._kept = None
        return 1

    def _hear(self, byte: int) -> None:
        if len(self.input) < INPUT_DEPTH:
            self.input.append(byte)
        else:
            self.lost_bytes += 1
