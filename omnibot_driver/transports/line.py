# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""One of several lines: its port, the bytes that wait for room, and its count of lost bytes.

This module does not know the other lines, and does not decide when a line is opened again.
"""

from collections.abc import Callable
from typing import Protocol

from omnibot_driver.transports import WRITE_TIMEOUT_S, Transport


class ByteLine(Transport, Protocol):
    """A ``Transport`` with a single channel, which carries bytes."""

    def drop_output(self) -> None:
        """Discard the written bytes that are not sent yet."""


Opener = Callable[[], ByteLine]


class Line:
    """One of several lines.

    ``trouble``: the reason why the line is missing; empty if it is present.

    ``was_open``: whether the line is open, or has been open before.

    ``waits``: the bytes that the line has not accepted yet.
    """

    def __init__(self, opener: Opener) -> None:
        self.opener = opener
        self.port: ByteLine | None = None
        self.descriptor: int | None = None
        self.trouble = "it is not open yet"
        self.retry_at = 0.0
        self.was_open = False
        self.waits = b""
        self.watched = False
        """Whether ``poll`` is set to report when the line accepts bytes again."""
        self._full_since = 0.0
        self._overruns = self._earlier_overruns = 0

    @property
    def overruns(self) -> int | None:
        """How often the kernel has lost bytes of this line; None if the kernel does not count.

        Earlier connections are included.
        """
        if self.port is not None:
            if (count := self.port.overruns) is None:
                return None
            self._overruns = count
        return self._earlier_overruns + self._overruns

    def begin(self, port: ByteLine) -> None:
        """Use ``port``, which has just been opened, for this line."""
        assert port.descriptors is not None
        self.port, (self.descriptor,) = port, port.descriptors
        self.trouble, self.waits, self.watched, self.was_open = "", b"", False, True
        self._earlier_overruns += self._overruns
        self._overruns = 0

    def write(self, data: bytes, now: float) -> bool:
        """Write the waiting bytes, then ``data``; return False if bytes have waited for 0.2 s.

        If the result is False, the caller must set ``trouble``. If the line is already missing, no
        bytes wait, so the result is True.
        """
        if self.port is None:
            return True
        if self.trouble:
            # The line is missing, but its port may still accept bytes.
            self.port.write_if_room(((0, data),))
            return True
        if not self.waits:
            self._full_since = now
        self.waits += data
        return self.flush(now)

    def flush(self, now: float) -> bool:
        """Write the waiting bytes; return False if bytes have been waiting continuously for 0.2 s.

        Bytes that are added meanwhile do not begin the 0.2 s anew. If the result is False, all
        unsent bytes are discarded.
        """
        assert self.port is not None
        if self.waits and not self.trouble:
            taken = self.port.write_if_room(((0, self.waits),))
            self.waits = self.waits[taken:]
            if self.waits and now - self._full_since >= WRITE_TIMEOUT_S:
                self.waits = b""
                self.port.drop_output()
                return False
        return True

    def end(self) -> ByteLine | None:
        """Forget the port and the waiting bytes; return the port, which the caller must close."""
        port, self.port, self.descriptor, self.waits = self.port, None, None, b""
        return port
