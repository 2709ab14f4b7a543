"""Stamps of a generated line against its true sampling times.

The line is that of ``test/integrity/truth.py``, with a crystal that is off, through the driver's
decoder and clock as a session uses them. What is true of every stamp is asserted on the way.
"""

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from random import Random
from statistics import fmean

sys.path.append(str(Path(__file__).parents[1] / "integrity"))

from truth import CHUNKERS, SCENARIOS, TICK_S, Chunks, Received, generate, receive

from omnibot_driver.core.board import ImuReading
from omnibot_driver.core.device_clock import DeviceClock
from omnibot_driver.core.imu import ImuScale
from omnibot_driver.core.omnibot import OmniBot, OmniBotSettings

JITTER_S = 60e-6
"""Mean of the host's own delay at each read, exponentially distributed."""


def ftdi_restarted(received: Received, random: Random) -> Chunks:
    """As ``ftdi``, but its timer begins with the first byte of each packet."""
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


@dataclass(slots=True)
class Stamped:
    """(tick, stamp, arrival) of the samples that came out; the true period of the ticks."""

    period_s: float
    samples: list[tuple[int, float, float]] = field(default_factory=list)

    def errors(self, since_s: float = 2.0) -> list[float]:
        """Stamp less sampling time, from so long after the first sample."""
        begin = self.samples[0][1] + since_s
        return [at - tick * self.period_s for tick, at, _ in self.samples if at >= begin]

    def unevenness(self, since_s: float = 2.0) -> float:
        """Standard deviation of the steps between successive samples from 10 ms."""
        begin = self.samples[0][1] + since_s
        return math.sqrt(
            fmean(
                (b[1] - a[1] - TICK_S) ** 2
                for a, b in pairwise(self.samples)
                if a[1] >= begin and b[0] == a[0] + 1
            )
        )


def spread(errors: list[float], part: float = 0.99) -> float:
    """Half the width of the narrowest interval that holds this part: error up to one constant."""
    ordered = sorted(errors)
    ends = zip(ordered, ordered[math.ceil(part * len(ordered)) - 1 :], strict=False)
    return min(high - low for low, high in ends) / 2


def stamp(line: str, scenario: str, loss: float, skew: float, seed: int, seconds: float) -> Stamped:
    """One stream from somewhere in its first second on."""
    random = Random(f"{line} {loss} {skew} {seed}")
    truth = generate(SCENARIOS[scenario], seed, seconds)
    start = random.randrange(1000)
    received = receive(
        truth, lambda n, r: [at for at in range(start, n) if not loss or r.random() >= loss], random
    )
    received.times_s = [100.0 + time * (1.0 + skew) for time in received.times_s]
    scale, ticks = ImuScale(), {}
    imus = [key for key, _, _ in truth.frames if key[0] == "imu"]
    for tick, (_, accel, gyro) in enumerate(imus):
        key = scale.specific_force(accel), scale.angular_velocity(gyro)
        ticks.setdefault(key, []).append(tick)
    stamped = Stamped(TICK_S * (1.0 + skew))
    bot, clock = OmniBot(OmniBotSettings()), DeviceClock(TICK_S)
    at, now, tick, last_s = 0, 0.0, -1, -math.inf
    for end, time in LINES[line](received, random):
        now = max(now, time + random.expovariate(1.0 / JITTER_S))
        readings = bot.receive(received.data[at:end], now)
        at = end
        stamps_s = clock.stamps(readings, now, bot.edge)
        for reading, stamp_s in zip(readings, stamps_s, strict=True):
            if isinstance(reading, ImuReading):
                assert last_s < stamp_s <= now
                last_s = stamp_s
                key = reading.specific_force, reading.angular_velocity
                found = next((t for t in ticks.get(key, ()) if tick < t < tick + 400), None)
                if found is not None:  # else the framing made it up
                    tick = found
                    stamped.samples.append((tick, stamp_s - 100.0, now - 100.0))
    return stamped
