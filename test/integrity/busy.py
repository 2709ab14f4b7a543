# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A busy computer: the line is undamaged, but the reading process runs late.

An adapter delivers bytes in *pieces*. One read of a late reader may return several pieces, or only
a part of a piece. A *chunker* returns the reads: for each read, the index after its last byte, and
the time in s.
"""

from bisect import bisect_right
from collections.abc import Callable
from random import Random

from carriage import CHUNKERS, Chunker, Chunks, Received
from truth import BYTE_S

LATE_SHARE, LATE_S = 0.02, (0.002, 0.030)
"""Share of late reads, and the range of their delay in s.

The values are for a navigation stack that runs beside the driver.
"""
STALL_SHARE, STALL_S = 0.002, (0.001, 0.300)
JITTER_S = 60e-6
"""Mean delay of any wake-up, in s. The delay is exponentially distributed."""
READ_S = 20e-6
"""Duration of a read that does not wait for data, in s."""
TURN_SHARE, TURN_S = 0.05, (0.0, 0.0095)
"""Share of the wake-ups that are late because of busy loops, and the range of their delay in s."""
BEHIND_SHARE, BEHIND_FOR_S = 1e-3, (0.02, 0.1)
"""How often and how long busy loops slow the process down.

``BEHIND_SHARE``: share of the wake-ups at which a slow period begins.

``BEHIND_FOR_S``: range of the duration of a slow period, in s.
"""
SHARE_S, SLOW_S = (0.002, 0.009), (0.0025, 0.004)
"""Ranges of the delay of a wake-up in a slowed process, in s.

``SHARE_S``: range for a reader. ``SLOW_S``: range for an adapter.
"""
HOGGED_PIECE = 4
SEGMENT_BYTES = (300, 6000)
"""Shortest and longest segment of a stream, in bytes.

In a segment, all pieces are of one kind, for example single bytes. The next segment can have
another kind of pieces.
"""


def delay_s(random: Random, now: float = 0.0) -> float:
    """Return a random delay of one wake-up, in s."""
    late_s = random.expovariate(1.0 / JITTER_S)
    kind = random.random()
    if kind < LATE_SHARE:
        late_s += random.uniform(*LATE_S)
    elif kind < LATE_SHARE + STALL_SHARE:
        late_s += random.uniform(*STALL_S)
    return late_s


class Turns:
    """The delays of a process's wake-ups while busy loops run.

    ``late_s``: the range of the delay in s while the process is slowed down.
    """

    def __init__(self, late_s: tuple[float, float]) -> None:
        self._late_s, self._steady_s, self._until_s = late_s, 0.0, 0.0

    def delay_s(self, random: Random, now: float) -> float:
        """Return a random delay in s for the wake-up at the time ``now``."""
        late_s = random.expovariate(1.0 / JITTER_S)
        kind = random.random()
        if kind < BEHIND_SHARE:
            self._until_s = now + random.uniform(*BEHIND_FOR_S)
            self._steady_s = random.uniform(*self._late_s)
        if now < self._until_s:
            return late_s + self._steady_s + random.uniform(0.0, 1e-3)
        return late_s + (random.uniform(*TURN_S) if kind > 1.0 - TURN_SHARE else 0.0)


def read(
    pieces: Chunks,
    random: Random,
    most: Callable[[], int],
    delay_s: Callable[[Random, float], float] = delay_s,
) -> Chunks:
    """Return the reads of a late reader, to which an adapter delivers the bytes in ``pieces``.

    ``most``: function that returns the largest number of bytes of the next read.
    """
    ends, times = zip(*pieces, strict=True)
    chunks: Chunks = []
    start, now = 0, 0.0
    while start < ends[-1]:
        piece = bisect_right(ends, start)  # the first that has not been read completely
        now += READ_S
        if times[piece] > now:
            now = times[piece] + delay_s(random, times[piece])
        there = ends[bisect_right(times, now) - 1]
        start = min(there, start + most())
        chunks.append((start, now))
    return chunks


def few_bytes_straddling(received: Received, random: Random) -> Chunks:
    """Deliver pieces of 1 to 8 bytes. Each piece is delivered when its last byte arrives.

    The line may be idle between two bytes of a piece.
    """
    chunks, at = [], 0
    while at < len(received.times_s):
        at = min(len(received.times_s), at + random.randint(1, 8))
        chunks.append((at, received.times_s[at - 1]))
    return chunks


def all_at_once(pieces: Chunker) -> Chunker:
    """Return a function that divides a stream into the reads of a late reader.

    Each read gets all bytes that have arrived.

    ``pieces``: how the adapter delivers the bytes.
    """
    return lambda received, random: read(pieces(received, random), random, lambda: 1 << 30)


def in_parts(received: Received, random: Random) -> Chunks:
    """Deliver single bytes to a late reader. A read takes 1 to 8 of the bytes that have arrived."""
    pieces = CHUNKERS["single bytes"](received, random)
    return read(pieces, random, lambda: random.randint(1, 8))


def each_by_itself(received: Received, random: Random) -> Chunks:
    """Deliver pieces of 1 to 8 bytes.

    The delay of each piece is independent of the other delays.
    """
    chunks: Chunks = []
    now = 0.0
    for end, time in few_bytes_straddling(received, random):
        now = max(now + READ_S, time + delay_s(random))
        chunks.append((end, now))
    return chunks


def mixed(received: Received, random: Random) -> Chunks:
    """Deliver pieces of randomly changing kinds to a late reader.

    The kinds are single bytes, a few bytes, bursts and packets. Each read takes all or some of the
    bytes that have arrived.
    """
    kinds = [*list(CHUNKERS.values())[:4], few_bytes_straddling]
    pieces: Chunks = []
    at, size = 0, len(received.data)
    while at < size:
        end = min(size, at + random.randint(*SEGMENT_BYTES))
        part = Received(received.data[at:end], received.times_s[at:end], [], [], received.truth)
        last_s = pieces[-1][1] if pieces else 0.0
        pieces += [(at + n, max(time, last_s)) for n, time in random.choice(kinds)(part, random)]
        at = end
    largest = 1 << 30

    def most() -> int:
        nonlocal largest
        if random.random() < STALL_SHARE:
            largest = random.choice([1, 8, 32, 1 << 30, 1 << 30])
        return random.randint(1, largest) if largest <= 8 else largest

    return read(pieces, random, most)


def hogged(received: Received, random: Random) -> Chunks:
    """Deliver 4 bytes at a time, while busy loops delay both the adapter and the reader."""
    times, pieces, at = received.times_s, [], 0
    adapter, free_s = Turns(SLOW_S), 0.0
    while at < len(times):
        start, at = at, at + 1
        while at < min(len(times), start + HOGGED_PIECE) and times[at] - times[at - 1] < 3e-3:
            at += 1
        begun_s = max(free_s, times[start] - BYTE_S)
        free_s = begun_s + (at - start) * BYTE_S + adapter.delay_s(random, begun_s)
        pieces.append((at, free_s))
    return read(pieces, random, lambda: 1 << 30, Turns(SHARE_S).delay_s)


READERS: dict[str, Chunker] = {
    "single bytes, late": all_at_once(CHUNKERS["single bytes"]),
    "1-8 bytes, late": all_at_once(few_bytes_straddling),
    "single bytes, late, in parts": in_parts,
    "1-8 bytes, each late by itself": each_by_itself,
    "all mixed": mixed,
}
BUSY_LOOPS: dict[str, Chunker] = {"4 bytes, busy loops beside": hogged}
"""Ways to divide a stream into reads while busy loops delay the adapter and the reader.

The times of the reads hardly show when the bytes arrived.
"""
