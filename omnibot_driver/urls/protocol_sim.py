# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""``sim://`` as a port of pyserial's: the transport of the simulated OmniBot in its clothes.

Knows pyserial's interface and no bytes.
"""

from typing import Any

from serial.serialutil import PortNotOpenError, SerialBase

from omnibot_driver.transports.simulated import SimulatedTransport


class Serial(SerialBase):
    """What pyserial opens for ``sim://``. Speed, parity and control lines are without effect."""

    _transport: SimulatedTransport | None = None
    _held = b""

    def open(self) -> None:
        """Power the board up. Raises LinkError where the URL is wrong."""
        self._transport = SimulatedTransport(str(self.port), "omnibot_driver.simulator.omnibot")
        self.is_open = True

    def close(self) -> None:
        """Power the board off; harmless to repeat."""
        transport, self._transport = self._transport, None
        self.is_open = False
        if transport is not None:
            transport.close()

    @property
    def in_waiting(self) -> int:
        """How many bytes ``read`` has at hand."""
        return len(self._held)

    def read(self, size: int = 1, /) -> bytes:
        """So many bytes at most; none when none came for a while."""
        if not self._held:
            self._held = self._opened.read()[1]
        data, self._held = self._held[:size], self._held[size:]
        return data

    def write(self, data: Any, /) -> int:
        """All of it, at once."""
        self._opened.write([(0, bytes(data))])
        return len(data)

    def cancel_read(self) -> None:
        """End a ``read`` that waits in another thread."""
        self._opened.interrupt()

    def reset_output_buffer(self) -> None:
        """Nothing waits to be sent."""

    @property
    def _opened(self) -> SimulatedTransport:
        if self._transport is None:
            raise PortNotOpenError
        return self._transport

    def _reconfigure_port(self) -> None:
        pass
