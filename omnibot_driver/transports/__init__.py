# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Transports that carry packets to a board and back: serial ports, datagrams, several lines.

Every LinkError says what to do. Transports must not know boards, or the threads that use them.
"""

from collections.abc import Mapping
from typing import Final, Protocol

from omnibot_driver.core.packets import Packet, Packets

READ_TIMEOUT_S: Final = 0.2
"""Longest time in s for which ``read`` waits, even on a port where ``interrupt`` cannot end it."""
WRITE_TIMEOUT_S: Final = 0.2
NOT_POLLABLE: Final = (
    "this kind of port does not work for a board with several ports; use a device like"
    " /dev/ttyACM0, or sim:// for all ports"
)
NONE_MISSING: Final[Mapping[int, str]] = {}
"""Value of ``missing`` if no line is missing, and after the transport was closed."""


class LinesChanged(Exception):
    """One of several lines was lost or opened again.

    ``Transport.missing`` shows which lines are missing.
    """


class Transport(Protocol):
    """A connection to a board, which is open from its construction until ``close``.

    The constructor raises LinkError if the connection cannot be opened.
    """

    @property
    def descriptors(self) -> tuple[int | None, ...] | None:
        """File descriptors in the order of the channels, for another process to inherit.

        A missing line has None. The result is None if descriptors cannot be inherited.
        """

    @property
    def missing(self) -> Mapping[int, str]:
        """The missing lines, by channel: why each is missing, and what to do."""

    @property
    def ends_with_us(self) -> bool:
        """Whether the board is in this process, such as a simulated board in memory.

        Such a board needs no guard process.
        """

    @property
    def overruns(self) -> int | None:
        """How often the kernel has lost bytes since the port was opened; None if it is unknown."""

    def read(self) -> Packet:
        """Wait for a packet; return an empty packet if none arrives for a while.

        Raises LinkError if no line is left. Raises LinesChanged if one of several lines was lost or
        opened again.
        """

    def write(self, packets: Packets) -> None:
        """Write all packets.

        If there are several lines, a line that was blocked for 0.2 s is regarded as missing. A
        missing line gets only the bytes that it accepts at once. Raises LinkError, and discards all
        unsent bytes, if the connection is lost.
        """

    def write_if_room(self, packets: Packets) -> int:
        """Write only the bytes that are accepted without waiting; return how many were accepted."""

    def interrupt(self) -> None:
        """End a ``read`` that waits in another thread, if this kind of port allows it."""

    def close(self) -> None:
        """Close the lines. A second call does nothing."""
