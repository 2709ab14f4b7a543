# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Several lines of bytes as one transport; each line is one channel.

If a line is missing or blocked, the other lines still work. Missing lines are opened again.

The *leading* line is the one whose device has the first path in alphabetical order. If another
program uses the leading line before this transport has opened it, this transport gives up all
lines. So if two drivers wait for the same lines, in any order, one of them gets all lines.
"""

import os
import select
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from omnibot_driver.core.errors import LinkError, PortInUse
from omnibot_driver.core.packets import Packet, Packets, joined
from omnibot_driver.transports import (
    NOT_POLLABLE,
    READ_TIMEOUT_S,
    WRITE_TIMEOUT_S,
    LinesChanged,
)
from omnibot_driver.transports.line import ByteLine, Line, Opener
from omnibot_driver.transports.wake_up import WakeUp

FULL: Final = f"it has not accepted all data within {WRITE_TIMEOUT_S:g} s"
RETRY_S: Final = 0.5
"""Time in s between two attempts to open a missing line. The attempts do not disturb other
lines."""


class Several:
    """A ``Transport`` of several lines. Each line is one channel. All lines are polled together."""

    def __init__(self, lines: Sequence[tuple[str, Opener]], retry_s: float = RETRY_S) -> None:
        """Open the lines, given as pairs of device name and opener.

        Raises LinkError if no line can be opened, a line does not support ``poll``, or another
        program uses the leading line (first path in alphabetical order).
        """
        self._retry_s = retry_s
        self._names = [name for name, _ in lines]
        self._lines = [Line(opener) for _, opener in lines]
        self._writing = threading.Lock()
        """Lock that protects the bytes not yet written, and the set of open lines."""
        self._ready: list[tuple[int, int]] = []
        self._arrivals = select.poll()
        self._channels: dict[int, int] = {}
        self._changed = False
        try:
            self._wake_up = WakeUp()
        except OSError as error:
            raise LinkError(
                f"cannot open a pipe inside the driver: {error.strerror or error}"
            ) from error
        self._arrivals.register(self._wake_up.descriptor, select.POLLIN)
        try:
            self._open_missing()
            self._require_one()
        except BaseException:
            self.close()
            raise
        self._changed = False

    @property
    def descriptors(self) -> tuple[int | None, ...] | None:
        """Descriptors of all lines, by channel, for the guard process to copy.

        A missing line has None, because a copy of its descriptor would prevent the reopening of the
        line.
        """
        return tuple(None if line.trouble else line.descriptor for line in self._lines)

    @property
    def missing(self) -> Mapping[int, str]:
        """Reasons why lines are missing, by channel."""
        return {channel: line.trouble for channel, line in enumerate(self._lines) if line.trouble}

    @property
    def ends_with_us(self) -> bool:
        """Whether the other ends of all open lines are in this process."""
        return all(port.ends_with_us for port in self._ports)

    @property
    def overruns(self) -> int | None:
        """How often the kernel has lost bytes, over all lines; None if an open line has no count.

        Earlier connections are included.
        """
        counts = [line.overruns for line in self._lines]
        return None if None in counts else sum(filter(None, counts))

    def read(self) -> Packet:
        """Return bytes that were received on one line.

        Raises LinesChanged if a line was lost or reopened. Raises LinkError if all lines are
        missing, or if another program uses the leading line (first path in alphabetical order)
        before the driver has opened it.
        """
        if not self._ready:
            if not self._changed:  # the guard process may still have a copy of a line just lost
                self._open_missing()
            self._ready = self._arrivals.poll(0.0 if self._changed else 1e3 * READ_TIMEOUT_S)
            self._write_what_waits(time.monotonic())
        if self._changed:
            self._changed, self._ready = False, []
            self._require_one()
            raise LinesChanged
        if not self._ready:
            return 0, b""
        ready, why = self._ready.pop()
        if ready == self._wake_up.descriptor:
            self._wake_up.answer()
            return 0, b""
        channel = self._channels.get(ready)
        if channel is None or why == select.POLLOUT:
            return 0, b""
        port = self._lines[channel].port
        assert port is not None
        try:
            return channel, port.read()[1]
        except LinkError as error:
            self._lose(channel, str(error))
            return 0, b""

    def write(self, packets: Packets) -> None:
        """Write each packet to its line, and keep the bytes that the line does not accept at once.

        If a line has had waiting bytes for 0.2 s, these are discarded, and the line is regarded as
        missing.
        """
        now = time.monotonic()
        with self._writing:
            for line, data in self._shared_out(packets):
                if not line.write(data, now):
                    self._miss(line, FULL)
            waits = self._changed or any(line.waits for line in self._lines)
        if waits:
            self._wake_up.ring()

    def write_if_room(self, packets: Packets) -> int:
        """Write to each line only the bytes that it accepts at once.

        Return the number of written bytes, over all lines.
        """
        with self._writing:
            return sum(
                line.port.write_if_room(((0, data),))
                for line, data in self._shared_out(packets)
                if line.port is not None
            )

    def interrupt(self) -> None:
        """End a ``read`` that waits in another thread."""
        self._wake_up.ring()

    def close(self) -> None:
        """Close the lines. A second call does nothing."""
        for line in self._lines:
            self._close(line)
        self._wake_up.close()

    @property
    def _ports(self) -> list[ByteLine]:
        return [line.port for line in self._lines if line.port is not None]

    def _shared_out(self, packets: Packets) -> Iterator[tuple[Line, bytes]]:
        """Yield each line once, with the joined bytes of all packets for this line.

        The lines are in the order of their first packets.
        """
        for channel in dict.fromkeys(channel for channel, _ in packets):
            own = tuple(packet for packet in packets if packet[0] == channel)
            yield self._lines[channel], joined(own)

    def _open_missing(self) -> None:
        """Open the missing lines whose retry is due.

        The port of a blocked line may still be open, and is closed first.
        """
        now = time.monotonic()
        for channel, line in enumerate(self._lines):
            if not line.trouble or now < line.retry_at:
                continue
            self._give_back(line)
            line.retry_at = now + self._retry_s
            try:
                port = line.opener()
            except LinkError as error:
                line.trouble = str(error)
                if isinstance(error, PortInUse) and not line.was_open and self._leads(channel):
                    raise
                continue
            if port.descriptors is None or len(port.descriptors) != 1:
                port.close()
                raise LinkError(NOT_POLLABLE)
            with self._writing:
                line.begin(port)
                assert line.descriptor is not None
                self._channels[line.descriptor] = channel
                self._arrivals.register(line.descriptor, select.POLLIN)
            self._changed = True

    def _leads(self, channel: int) -> bool:
        paths = [os.path.realpath(name) for name in self._names]  # a symbolic link may change
        own = paths.pop(channel)
        return all(own < other for other in paths)

    def _write_what_waits(self, now: float) -> None:
        """Write the waiting bytes; if some remain, let ``poll`` report when the line accepts more.

        A line that has had waiting bytes for 0.2 s (``WRITE_TIMEOUT_S``) becomes a missing line.
        """
        with self._writing:
            for line in self._lines:
                if line.descriptor is None or not (line.waits or line.watched):
                    continue
                if not line.flush(now):
                    self._miss(line, FULL)
                line.watched = bool(line.waits)
                mask = select.POLLIN | (select.POLLOUT if line.waits else 0)
                self._arrivals.modify(line.descriptor, mask)

    def _lose(self, channel: int, why: str) -> None:
        line = self._lines[channel]
        self._miss(line, why)
        self._give_back(line)

    def _miss(self, line: Line, why: str) -> None:
        line.trouble, line.retry_at = why, time.monotonic() + self._retry_s
        self._changed = True

    def _give_back(self, line: Line) -> None:
        if line.descriptor is not None:
            del self._channels[line.descriptor]
            self._arrivals.unregister(line.descriptor)
        self._close(line)

    def _close(self, line: Line) -> None:
        with self._writing:
            port = line.end()
        # The lock is released, because ``close`` may wait until the kernel has sent its output.
        if port is not None:
            port.close()

    def _require_one(self) -> None:
        """Raise LinkError if all lines are missing. It says why the first line is missing."""
        if len(self.missing) == len(self._lines):
            raise LinkError(self._lines[0].trouble)
