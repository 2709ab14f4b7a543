# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A board's byte stream with known sampling times, and the ways in which it reaches a host.

The module is written from the manual, without code of the driver. Times are host times in s.
"""

import math
import random
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass

BYTE_S = 10 / 115200
TICK_S = 0.01

Byte = tuple[float, int]
Read = tuple[float, bytes]
Chunker = Callable[[list[Byte], random.Random], Iterator[Read]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Board:
    """A simulated stream of frames from a board.

    ``skew``: relative error of the tick's duration by the host's clock; positive if ticks are too
    long. ``loss``: fraction of lost frames.
    """

    seconds: float
    skew: float = 0.0
    loss: float = 0.0
    imu_only: bool = False
    begins_at: float = 1000.0
    first_tick: int = 0

    def sampled_at(self, tick: int) -> float:
        return self.begins_at + (tick - self.first_tick) * TICK_S * (1.0 + self.skew)

    def stream(self, rng: random.Random) -> list[Byte]:
        """Return every byte with the time at which its stop bit ends."""
        line: list[Byte] = []
        free_at = 0.0
        for tick in range(self.first_tick, self.first_tick + round(self.seconds / TICK_S)):
            free_at = max(free_at, self.sampled_at(tick) + 0.0003)
            for frame in self._frames(tick, rng):
                if rng.random() >= self.loss:
                    for byte in frame:
                        free_at += BYTE_S
                        line.append((free_at, byte))
                else:
                    free_at += BYTE_S * len(frame)
        return line

    def _frames(self, tick: int, rng: random.Random) -> list[bytes]:
        """Return the frames of a tick. The tick's number is in the accelerometer's x and y."""
        gyro = [rng.randrange(-3, 40) for _ in range(3)]
        frames = [struct.pack(">2B6h", 0xFF, 0xFA, tick % 8192, tick // 8192, 16384, *gyro)]
        if not self.imu_only and tick % 4 == 0:
            frames.append(struct.pack(">2B3hB", 0xFF, 0xFB, tick // 4, 0, 0, tick // 4 % 256))
        if not self.imu_only and tick % 20 == 0:
            frames.append(struct.pack(">2B3fB", 0xFF, 0xFC, 0.0, 0.0, 0.0, tick // 20 % 256))
        return frames


def bursts(line: list[Byte], _rng: random.Random) -> Iterator[Read]:
    """Split the stream into reads as on an ideal line. A read has all bytes between two pauses."""
    held = bytearray()
    last = line[0][0]
    for at, byte in line:
        if at - last > 2 * BYTE_S:
            yield last, bytes(held)
            held.clear()
        held.append(byte)
        last = at
    yield last, bytes(held)


def singles(line: list[Byte], _rng: random.Random) -> Iterator[Read]:
    for at, byte in line:
        yield at, bytes([byte])


def crumbs(line: list[Byte], rng: random.Random) -> Iterator[Read]:
    start = 0
    while start < len(line):
        piece = line[start : start + rng.randint(1, 8)]
        yield piece[-1][0], bytes(byte for _, byte in piece)
        start += len(piece)


def blocks(line: list[Byte], _rng: random.Random) -> Iterator[Read]:
    for start in range(0, len(line), 4096):
        piece = line[start : start + 4096]
        yield piece[-1][0], bytes(byte for _, byte in piece)


def ftdi(
    *, latency_s: float = 0.016, restarted_by_data: bool = False, skew: float = 0.0
) -> Chunker:
    """Return a function that splits the stream into packets of 62 bytes, as an FTDI adapter does.

    A packet is shorter if the timer of ``latency_s`` runs out. ``restarted_by_data``: whether a
    packet's first byte restarts the timer.
    """

    def chunk(line: list[Byte], rng: random.Random) -> Iterator[Read]:
        period = latency_s * (1.0 + skew)
        expires = line[0][0] - rng.random() * period
        held = bytearray()
        for at, byte in line:
            if held and at > expires:
                yield expires, bytes(held)
                held.clear()
            while not restarted_by_data and at > expires:
                expires += period
            if restarted_by_data and not held:
                expires = at + period
            held.append(byte)
            if len(held) == 62:
                yield at, bytes(held)
                held.clear()
                expires = at + period
        if held:
            yield expires, bytes(held)

    return chunk


def late(
    reads: Iterator[Read],
    rng: random.Random,
    *,
    jitter_s: float = 0.0,
    stalls: list[tuple[float, float]] | None = None,
) -> Iterator[Read]:
    """Delay the reads, as a host does that wakes up late.

    Data that arrives before the host wakes up is read together.
    """
    pending = bytearray()
    wakes = -math.inf
    for at, data in reads:
        if pending and at > wakes:
            yield wakes, bytes(pending)
            pending.clear()
        if not pending:
            wakes = at + (rng.expovariate(1.0 / jitter_s) if jitter_s else 0.0)
            for begin, end in stalls or []:
                if begin <= wakes < end:
                    wakes = end
        pending += data
    yield wakes, bytes(pending)
