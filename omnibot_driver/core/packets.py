# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Packets: bytes, each with the channel that carries them.

A channel is a serial line or UDP port, numbered as in ``Traits.channels``. Each UDP packet is one
datagram.
"""

from typing import Final

Packet = tuple[int, bytes]
"""A pair: the number of the channel, and the bytes."""
Packets = tuple[Packet, ...]
"""Packets in the order in which they are sent."""

NO_PACKETS: Final[Packets] = ()


def packed(data: bytes, channel: int = 0) -> Packets:
    """Return the bytes as one packet, or no packet if ``data`` is empty."""
    return ((channel, data),) if data else NO_PACKETS


def joined(packets: Packets) -> bytes:
    """Return the bytes of all packets, concatenated. The packets must have the same channel."""
    return b"".join([data for _, data in packets])
