# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What carries packets to a board and back: serial ports, datagrams, several lines at once.

Knows descriptors and bytes; no threads and no board. Every failure is a LinkError whose sentence
says what to do.
"""

from collections.abc import Mapping
from typing import Final, Protocol

from omnibot_driver.core.packets import Packet, Packets

READ_TIMEOUT_S: Final = 0.2
"""How soon a transport that cannot be interrupted returns to look whether it is still wanted."""
WRITE_TIMEOUT_S: Final = 0.2
NONE_MISSING: Final[Mapping[int, str]] = {}
"""Of a transport that is open as a whole or not at all."""


class LinesChanged(Exception):
    """One of several lines is lost or is there again; ``missing`` says which are not there now."""


class Transport(Protocol):
    """Open from its construction, which raises LinkError, until ``close``."""

    @property
    def descriptors(self) -> tuple[int | None, ...] | None:
        """By channel: what another process may inherit to write the same bytes.

        None where it can't, and in the place of a line that is missing.
        """

    @property
    def missing(self) -> Mapping[int, str]:
        """Of several lines, those that are not there, by channel: why, and what to do."""

    @property
    def ends_with_us(self) -> bool:
        """Whether nothing outside this process receives what is written."""

    @property
    def overruns(self) -> int | None:
        """How often the kernel has lost bytes since the opening; None without a counter."""

    def read(self) -> Packet:
        """What has come in, waiting for it; no bytes after a while without any.

        Raises LinkError when the line is lost, and LinesChanged when one of several is lost or is
        there again.
        """

    def write(self, packets: Packets) -> None:
        """All of them, or LinkError; then nothing that was written and is still here is sent.

        What goes to one of several lines that is missing is dropped.
        """

    def write_if_room(self, packets: Packets) -> int:
        """Write what is accepted at once, perhaps nothing; returns the number of bytes."""

    def interrupt(self) -> None:
        """End a ``read`` that waits in another thread, where it can be ended."""

    def close(self) -> None:
        """Give the lines back; harmless to repeat."""
