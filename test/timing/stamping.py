# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Stamps that the driver computes for a generated stream, compared with the true sampling times.

``test/integrity`` generates the stream. The board's clock is fast or slow.
"""

import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from random import Random
from statistics import fmean

sys.path.append(str(Path(__file__).parents[1] / "integrity"))

from busy import READERS
from carriage import CHUNKERS, Chunks, Received, receive
from truth import SCENARIOS, TICK_S, Truth, generate

from omnibot_driver.core.imu.scale import ImuScale
from omnibot_driver.core.omnibot import OmniBot, OmniBotSettings
from omnibot_driver.core.readings import ImuReading, PausedReading
from omnibot_driver.core.timing.device_clock import DeviceClock

JITTER_S = 60e-6
"""Mean of the host's own delay at each read, in s. The delays are exponentially distributed."""
READ_S = 20e-6
EPOCH_S = 100.0
SETTLED_S = 2.0
EVENTS_S = {"none": 0.0, "the board restarts": 0.0, "stall of 0.3 s": 0.3, "stall of 2 s": 2.0}
"""Events in the middle of a stream, each with the time in s for which the host does not read."""
RESTART = "the board restarts"
stream_of = lru_cache(maxsize=4)(generate)
"""``generate`` with a cache. Callers may get the same stream, so they must not change it."""
BOOT_S = 0.7123


def ftdi_restarted(received: Received, random: Random) -> Chunks:
    """Return the chunks in which an FTDI adapter delivers the bytes.

    The first byte of a chunk starts the latency timer of this adapter. Later bytes do not restart
    the timer.
    """
    chunks: Chunks = []
    start, timer = 0, math.inf
    for at, time in enumerate(received.times_s):
        if time > timer:
            chunks.append((at, timer))
            start, timer = at, math.inf
        if at == start:
            timer = time + 0.016
        if at + 1 - start == 62:
            chunks.append((at + 1, time))
            start, timer = at + 1, math.inf
    return chunks


LINES: dict[str, Callable[[Received, Random], Chunks]] = {
    **CHUNKERS,
    "FTDI, timer restarted by data": ftdi_restarted,
}
BUSY = dict(READERS)
"""Functions that return the reads of a busy computer. The keys say how bytes arrive and are read.

The times of the reads contain the computer's delays, so ``stamp`` adds none.
"""


@dataclass(slots=True)
class Stamped:
    """The stamps of one stream. All times are in s.

    ``sampled_s``: the true sampling time of each tick.

    ``restarted_s``: when the board restarted, or infinity.

    ``samples``: for each sample its tick, stamp and arrival time.
    """

    sampled_s: list[float]
    restarted_s: float
    samples: list[tuple[int, float, float]] = field(default_factory=list)

    def errors(self, since_s: float = SETTLED_S) -> list[float]:
        """Return stamp minus true time of each sample, in s.

        Samples within ``since_s`` after the start or a restart are left out.
        """
        return [at - self.sampled_s[tick] for tick, at, _ in self._settled(since_s)]

    def unevenness(self, since_s: float = SETTLED_S) -> float:
        """Return how much the steps between successive stamps deviate from 10 ms, as RMS in s.

        Samples within ``since_s`` after the start or a restart are left out.
        """
        return math.sqrt(
            fmean(
                (b[1] - a[1] - TICK_S) ** 2
                for a, b in pairwise(self._settled(since_s))
                if b[0] == a[0] + 1
            )
        )

    def _settled(self, since_s: float) -> list[tuple[int, float, float]]:
        begins = (self.sampled_s[self.samples[0][0]], self.restarted_s)
        return [
            sample
            for sample in self.samples
            if not any(0.0 <= self.sampled_s[sample[0]] - begin < since_s for begin in begins)
        ]


def spread(errors: list[float], part: float = 0.99) -> float:
    """Return half the width of the narrowest interval that contains the share ``part`` of errors.

    With ``part`` = 0.99, the interval contains at least 99 % of the errors.
    """
    ordered = sorted(errors)
    ends = zip(ordered, ordered[math.ceil(part * len(ordered)) - 1 :], strict=False)
    return min(high - low for low, high in ends) / 2


def stamp(
    line: str,
    scenario: str,
    loss: float,
    skew: float,
    seed: int,
    seconds: float,
    event: str = "none",
) -> Stamped:
    """Generate one stream and stamp its samples.

    ``loss``: share of lost bytes. ``skew``: relative error of the board's tick; positive if it is
    too long. ``event``: what happens in the middle of the stream, a key of ``EVENTS_S``. The host
    begins to read at a random time in the first second.
    """
    random = Random(f"{line} {loss} {skew} {seed}")
    truth = stream_of(SCENARIOS[scenario], seed, seconds / 2 if event == RESTART else seconds)
    ticks = sum(key[0] == "imu" for key, _, _ in truth.frames)
    sampled_s = [tick * TICK_S for tick in range(ticks)]
    restarted_s = math.inf
    if event == RESTART:
        restarted_s = seconds / 2 + BOOT_S + random.random()
        again = stream_of(SCENARIOS[scenario], seed + 1000, seconds / 2)
        sampled_s += [math.nan, *(restarted_s + time for time in sampled_s)]
        truth = _one_after_the_other(truth, again, restarted_s)
    start = random.randrange(1000)
    received = receive(
        truth, lambda n, r: [at for at in range(start, n) if not loss or r.random() >= loss], random
    )
    received.times_s = [EPOCH_S + time * (1.0 + skew) for time in received.times_s]
    scale = ImuScale()
    ticks_of: dict[object, list[int]] = {}
    tick = 0
    for kind, *words in (key for key, _, _ in truth.frames):
        if kind == "imu":
            key = scale.specific_force(words[0]), scale.angular_velocity(words[1])
            ticks_of.setdefault(key, []).append(tick)
        tick += kind in ("imu", "text")
    stamped = Stamped([time * (1.0 + skew) for time in sampled_s], restarted_s * (1.0 + skew))
    bot, clock = OmniBot(OmniBotSettings()), DeviceClock(TICK_S)
    tick, last_s = -1, -math.inf
    if line in BUSY:
        reads = _as_read(received.data, BUSY[line](received, random))
    else:
        chunks = LINES[line](received, random)
        reads = _reads(received.data, chunks, random, EPOCH_S + seconds / 2, EVENTS_S[event])
    for data, now in reads:
        readings = bot.receive(data, now)
        stamps_s = clock.stamps(readings, now, bot.edge)
        for reading, stamp_s in zip(readings, stamps_s, strict=True):
            if isinstance(reading, PausedReading):
                clock.restart()
            elif isinstance(reading, ImuReading):
                assert last_s < stamp_s <= now
                last_s = stamp_s
                sent = ticks_of.get((reading.specific_force, reading.angular_velocity), ())
                found = next((t for t in sent if tick < t < tick + 400), None)
                if found is not None:  # else it is not a real sample
                    tick = found
                    stamped.samples.append((tick, stamp_s - EPOCH_S, now - EPOCH_S))
    return stamped


def _one_after_the_other(before: Truth, after: Truth, begins_s: float) -> Truth:
    """Return one stream: first ``before``, then the boot text of a board, then ``after``."""
    text = b"Paused: 0 \n"
    at = len(before.data) + len(text)
    boots_s = before.times_s[-1] + 0.5
    return Truth(
        before.data + text + after.data,
        [
            *before.times_s,
            *(boots_s + n * 1e-4 for n in range(len(text))),
            *(begins_s + time for time in after.times_s),
        ],
        [
            *before.frames,
            (("text", 0), at - len(text), at),
            *((key, at + start, at + end) for key, start, end in after.frames),
        ],
    )


def _as_read(data: bytes, chunks: Chunks) -> Iterator[tuple[bytes, float]]:
    at = 0
    for end, now in chunks:
        yield data[at:end], now
        at = end


def _reads(
    data: bytes, chunks: Chunks, random: Random, stalls_at: float, stall_s: float
) -> Iterator[tuple[bytes, float]]:
    """Yield the bytes and the time of each read of a host, which reads each chunk a little late.

    At the time ``stalls_at``, the host stalls for ``stall_s``. Both times are in s.
    """
    at, now = 0, 0.0
    for number, (end, time) in enumerate(chunks):
        now = max(now + READ_S, time + random.expovariate(1.0 / JITTER_S))
        if stalls_at <= now < stalls_at + stall_s:
            if number + 1 < len(chunks) and chunks[number + 1][1] < stalls_at + stall_s:
                continue
            now = stalls_at + stall_s
        yield data[at:end], now
        at = end
