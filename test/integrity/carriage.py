# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What a line does to a byte stream: bytes are lost or added, and they arrive in chunks.

This module depends on bytes and times, not on the format of frames.
"""

from collections.abc import Callable
from dataclasses import dataclass
from random import Random

from truth import BYTE_S, Truth

Origins = list[int]
"""For each byte that arrives: its position in the stream that was sent, or -1 for an added byte."""
Fault = Callable[[int, Random], Origins]


def none(length: int, random: Random) -> Origins:
    """Damage no byte. The host begins to read at a random byte of the first second."""
    return list(range(random.randrange(1700), length))


def lost(rate: float) -> Fault:
    """Return a fault that loses single bytes, each with the probability ``rate``."""

    def fault(length: int, random: Random) -> Origins:
        return [at for at in range(length) if random.random() >= rate]

    return fault


def added(rate: float) -> Fault:
    """Return a fault that adds bytes of any value, at each place with the probability ``rate``."""

    def fault(length: int, random: Random) -> Origins:
        origins: Origins = []
        for at in range(length):
            if random.random() < rate:
                origins.append(-1)
            origins.append(at)
        return origins

    return fault


def bursts(rate: float) -> Fault:
    """Return a fault that loses 1 to 200 bytes in a row.

    ``rate``: for each byte, the probability that such a loss begins with it.
    """

    def fault(length: int, random: Random) -> Origins:
        origins: Origins = []
        at = 0
        while at < length:
            if random.random() < rate:
                at += random.randint(1, 200)
            else:
                origins.append(at)
                at += 1
        return origins

    return fault


FAULTS: dict[str, Fault] = {
    "none, starting anywhere": none,
    "1 byte in 1,000 lost": lost(1e-3),
    "1 byte in 100 lost": lost(1e-2),
    "1 byte in 1,000 added": added(1e-3),
    "bursts of 1-200 bytes lost": bursts(5e-4),
}


@dataclass(slots=True)
class Received:
    """The bytes that have arrived, and the stream that was sent.

    ``times_s``: for each byte, the time in s at which it arrived. ``truth``: the stream as it was
    sent, without damage.
    """

    data: bytes
    times_s: list[float]
    origins: Origins
    intact: list[bool]
    """One value for each sent frame: whether all its bytes have arrived, without added bytes
    between them."""
    truth: Truth


def receive(truth: Truth, fault: Fault, random: Random) -> Received:
    """Send the true stream through a faulty line; return the stream that the host receives."""
    origins = fault(len(truth.data), random)
    data = bytes(truth.data[at] if at >= 0 else random.randrange(256) for at in origins)
    times, last = [], 0.0
    for at in origins:
        last = truth.times_s[at] if at >= 0 else last + BYTE_S / 2
        times.append(last)
    place = [-1] * len(truth.data)
    for index, at in enumerate(origins):
        if at >= 0:
            place[at] = index
    intact = [
        place[start] >= 0
        and place[end - 1] - place[start] == end - 1 - start
        and all(p >= 0 for p in place[start:end])
        for _, start, end in truth.frames
    ]
    return Received(data, times, origins, intact, truth)


Chunks = list[tuple[int, float]]
"""For each chunk, the index after its last byte, and the time in s of its arrival at the host."""
Chunker = Callable[[Received, Random], Chunks]


def single_bytes(received: Received, random: Random) -> Chunks:
    """Deliver each byte when it arrives."""
    return [(at + 1, time) for at, time in enumerate(received.times_s)]


def few_bytes(received: Received, random: Random) -> Chunks:
    """Deliver pieces of 1 to 8 bytes, even if the line is idle within a piece.

    A piece lasts at most 16 ms, because an adapter holds no byte for longer.
    """
    times, chunks, at = received.times_s, [], 0
    while at < len(times):
        start, at = at, min(len(times), at + random.randint(1, 8))
        while times[at - 1] - times[start] > 0.016:
            at -= 1
        chunks.append((at, times[at - 1]))
    return chunks


def whole_bursts(received: Received, random: Random) -> Chunks:
    """Deliver all waiting bytes when the line becomes idle, as some adapters do.

    A gap of more than 3 ms between two bytes counts as idle.
    """
    times = received.times_s
    ends = [n for n in range(1, len(times)) if times[n] - times[n - 1] > 3e-3] + [len(times)]
    return [(end, times[end - 1]) for end in ends]


def ftdi(received: Received, random: Random) -> Chunks:
    """Deliver 62 bytes at a time, or fewer when the adapter's latency timer of 16 ms expires."""
    chunks: Chunks = []
    start, timer = 0, received.times_s[0] + random.uniform(0, 0.016)
    for at, time in enumerate(received.times_s):
        while time > timer:
            if at > start:
                chunks.append((at, timer))
                start = at
            timer += 0.016
        if at + 1 - start == 62:
            chunks.append((at + 1, time))
            start, timer = at + 1, time + 0.016
    if start < len(received.data):
        chunks.append((len(received.data), timer))
    return chunks


def blocks(received: Received, random: Random) -> Chunks:
    """Deliver 4096 bytes at a time."""
    length = len(received.data)
    ends = [*range(4096, length, 4096), length]
    return [(end, received.times_s[end - 1]) for end in ends]


CHUNKERS: dict[str, Chunker] = {
    "single bytes": single_bytes,
    "1-8 bytes": few_bytes,
    "whole bursts": whole_bursts,
    "FTDI": ftdi,
    "4096-byte blocks": blocks,
}
GAPS_VISIBLE = ("single bytes", "1-8 bytes", "whole bursts")
