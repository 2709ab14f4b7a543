# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What goes over a line: bytes with the channel that carries them.

A board has one channel or several: serial lines, or ports of datagrams. They are numbered from 0 in
the order of ``Traits.channels``. On a channel of datagrams a packet is one of them.
"""

from typing import Final

Packet = tuple[int, bytes]
"""Channel and bytes."""
Packets = tuple[Packet, ...]
"""In the order in which they are sent."""

NO_PACKETS: Final[Packets] = ()


def packed(data: bytes, channel: int = 0) -> Packets:
    """One packet, or none if there are no bytes."""
    return ((channel, data),) if data else NO_PACKETS


def joined(packets: Packets) -> bytes:
    """The bytes of all packets, one after the other; for boards of one channel."""
    return b"".join([data for _, data in packets])
