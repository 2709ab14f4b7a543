# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Transports that carry packets to a board and back: serial ports, datagrams, several lines.

The transports know descriptors and bytes, but not threads or boards. Every failure is a LinkError
whose text says what to do.
"""

from collections.abc import Mapping
from typing import Final, Protocol

from omnibot_driver.core.packets import Packet, Packets

READ_TIMEOUT_S: Final = 0.2
"""Longest wait of a ``read``, in s, even if ``interrupt`` cannot end the ``read``."""
WRITE_TIMEOUT_S: Final = 0.2
NONE_MISSING: Final[Mapping[int, str]] = {}
"""Value of ``missing`` for a transport that is either completely open or closed."""


class LinesChanged(Exception):
    """One of several lines was lost or reopened; ``Transport.missing`` has the missing lines."""


class Transport(Protocol):
    """A connection to a board, open from construction (which raises LinkError) to ``close``."""

    @property
    def descriptors(self) -> tuple[int | None, ...] | None:
        """File descriptors by channel; another process may inherit them to write the same bytes.

        None if descriptors cannot be inherited. The item of a missing line is None.
        """

    @property
    def missing(self) -> Mapping[int, str]:
        """Missing lines by channel, each with the reason and what to do; empty if all are open."""

    @property
    def ends_with_us(self) -> bool:
        """Whether nothing outside this process receives what is written."""

    @property
    def overruns(self) -> int | None:
        """Number of times the kernel has lost bytes since the opening; None without a counter."""

    def read(self) -> Packet:
        """Wait for a packet and return it; return an empty packet if none arrives for a while.

        Raises LinkError when the line is lost, and LinesChanged when one of several lines is lost
        or open again.
        """

    def write(self, packets: Packets) -> None:
        """Write all packets. On LinkError, what was written but not yet sent is discarded.

        Packets for a missing line are discarded.
        """

    def write_if_room(self, packets: Packets) -> int:
        """Write the bytes that are accepted at once, perhaps none; return the number of bytes."""

    def interrupt(self) -> None:
        """End a ``read`` that waits in another thread, if this kind of port allows it."""

    def close(self) -> None:
        """Close the lines. A second call does nothing."""
