# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Several lines as one transport: the channels of each follow those of the one before it.

A line that is lost or takes nothing keeps none of the others from being read or written.
"""

import contextlib
import os
import select
from collections.abc import Callable, Iterator, Sequence

from omnibot_driver.core.errors import LinkError
from omnibot_driver.core.packets import Packet, Packets
from omnibot_driver.transports import READ_TIMEOUT_S, Transport


class Several:
    """A ``Transport`` of lines of one channel each that can be waited for together."""

    def __init__(self, openers: Sequence[Callable[[], Transport]], stop: Packets = ()) -> None:
        """``stop``: what those that are open are told while another cannot be opened."""
        self._lines: list[Transport] = []
        self._channels: dict[int, int] = {}
        self._ready: list[int] = []
        self._wakes = self._wake = -1
        self._arrivals = select.poll()
        try:
            self._wakes, self._wake = os.pipe()
            self._arrivals.register(self._wakes, select.POLLIN)
            for opener in openers:
                self._add(opener())
        except BaseException as error:
            with contextlib.suppress(LinkError):
                self.write(stop)
            self.close()
            if isinstance(error, OSError):
                raise LinkError(f"cannot open a line: {error.strerror or error}") from error
            raise

    @property
    def descriptors(self) -> tuple[int, ...] | None:
        """Of all lines."""
        return tuple(self._channels)

    @property
    def ends_with_us(self) -> bool:
        """Where that is so of every line."""
        return all(line.ends_with_us for line in self._lines)

    @property
    def overruns(self) -> int | None:
        """Of those that count."""
        counts = [line.overruns for line in self._lines]
        return None if None in counts else sum(filter(None, counts))

    def read(self) -> Packet:
        """What has come in on one of them; each in its turn."""
        if not self._ready:
            self._ready = [ready for ready, _ in self._arrivals.poll(1e3 * READ_TIMEOUT_S)]
        if not self._ready:
            return 0, b""
        ready = self._ready.pop()
        if ready == self._wakes:
            os.read(ready, 1000)
            return 0, b""
        channel = self._channels[ready]
        return channel, self._lines[channel].read()[1]

    def write(self, packets: Packets) -> None:
        """To each line what is its own."""
        failed: LinkError | None = None
        for line, own in self._shared_out(packets):
            try:
                line.write(own)
            except LinkError as error:
                failed = failed or error
        if failed is not None:
            raise failed

    def write_if_room(self, packets: Packets) -> None:
        """To each line what is its own."""
        for line, own in self._shared_out(packets):
            line.write_if_room(own)

    def interrupt(self) -> None:
        """End a ``read`` that waits in another thread."""
        with contextlib.suppress(OSError):
            os.write(self._wake, b"\0")

    def close(self) -> None:
        """Harmless to repeat."""
        for line in self._lines:
            line.close()
        for descriptor in (self._wakes, self._wake):
            if descriptor >= 0:
                os.close(descriptor)
        self._lines, self._wakes, self._wake = [], -1, -1

    def _shared_out(self, packets: Packets) -> Iterator[tuple[Transport, Packets]]:
        """To each line that is open its own, the first to be written to first."""
        for channel in dict.fromkeys(channel for channel, _ in packets):
            if channel < len(self._lines):
                own = tuple((0, data) for other, data in packets if other == channel)
                yield self._lines[channel], own

    def _add(self, line: Transport) -> None:
        self._lines.append(line)
        if line.descriptors is None or len(line.descriptors) != 1:
            raise LinkError(
                "a port of this kind cannot be one of several: use a device like /dev/ttyACM0, or"
                " sim:// for all of them"
            )
        (descriptor,) = line.descriptors
        self._channels[descriptor] = len(self._lines) - 1
        self._arrivals.register(descriptor, select.POLLIN)
