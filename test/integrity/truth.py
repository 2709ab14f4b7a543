# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The generator of truth: what a board sends, frame by frame and byte by byte, with arrival times.

Typed from the manual's layouts with ``struct``; it shares nothing with the driver. Sensor noise is
that of an MPU6050 with its filter on: some 46 counts on the accelerometer, 6.5 on the gyro.
"""

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random

TICK_S = 0.01
BYTE_S = 10 / 115200

Words = tuple[int, int, int]
Key = tuple[object, ...]
"""A frame's content: its kind, then its fields."""


@dataclass(slots=True)
class Truth:
    """Bytes, their arrival times, and the frames (content, first byte, one past the last)."""

    data: bytearray = field(default_factory=bytearray)
    times_s: list[float] = field(default_factory=list)
    frames: list[tuple[Key, int, int]] = field(default_factory=list)


@dataclass(slots=True)
class Motion:
    """Velocities that chase random targets, as a drive does; all zero for a robot at rest."""

    random: Random
    driving: bool
    v: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    target: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    pose: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])

    def step(self) -> tuple[float, float]:
        """One tick; the acceleration along the body's x and y, in m/s²."""
        if not self.driving:
            return 0.0, 0.0
        if self.random.random() < 0.02:
            self.target = [self.random.uniform(-0.5, 0.5) for _ in range(3)]
        change = [(t - v) * 0.08 for t, v in zip(self.target, self.v, strict=True)]
        self.v = [v + c for v, c in zip(self.v, change, strict=True)]
        heading = self.pose[2]
        c, s = math.cos(heading), math.sin(heading)
        self.pose[0] += (c * self.v[0] - s * self.v[1]) * TICK_S
        self.pose[1] += (s * self.v[0] + c * self.v[1]) * TICK_S
        self.pose[2] += self.v[2] * TICK_S
        return change[0] / TICK_S, change[1] / TICK_S


@dataclass(frozen=True, slots=True)
class Scenario:
    """How the robot moves and what its sensor reads at rest."""

    driving: bool = False
    imu_only: bool = False
    gyro_stuck: Words | None = None
    accel_mean: Words = (250, -130, -16380)
    accel_noise: float = 46.0
    gyro_noise: float = 6.5
    pauses: bool = False
    """Now and then the board is paused for some seconds: a text each second, and silence."""


SCENARIOS: dict[str, Scenario] = {
    "driving": Scenario(driving=True),
    "at rest, noisy gyro": Scenario(),
    "gyro stuck at (-6, -5, -4)": Scenario(gyro_stuck=(-6, -5, -4)),
    "IMU only, noisy gyro": Scenario(imu_only=True),
    "IMU only, gyro stuck": Scenario(imu_only=True, gyro_stuck=(-6, -5, -4)),
    "tilted": Scenario(accel_mean=(-5, -16383, -5), accel_noise=12.0),
    "paused now and then": Scenario(driving=True, pauses=True),
}
WITH_TEXTS = "paused now and then"


def generate(scenario: Scenario, seed: int, seconds: float) -> Truth:
    """What this board sends from some moment of its life on."""
    random = Random(f"{scenario} {seed}")
    gauss = random.gauss
    bias = [random.uniform(-6, 6) for _ in range(3)]
    motion = Motion(random, scenario.driving)
    sent = [0, 0, 0]
    delta_seq, pose_seq = random.randrange(256), random.randrange(256)
    truth = Truth()
    deltas, texts = random.randrange(5), 0
    paused, toggles_at = False, random.randrange(100, 500)
    for tick in range(round(seconds / TICK_S)):
        now = tick * TICK_S + random.uniform(0, 1e-4)
        if scenario.pauses and tick == toggles_at:
            paused, texts = not paused, 0
            toggles_at += random.randrange(100, 500)
        if paused:
            if (toggles_at - tick) % 100 == 0:
                packed = b"Paused: %d \n" % texts
                _append(truth, ("text", texts), packed, now)
                texts += 1
            continue
        ax, ay = motion.step()
        mean = scenario.accel_mean
        accel = (
            round(gauss(mean[0] + ax * 1671, scenario.accel_noise)),
            round(gauss(mean[1] - ay * 1671, scenario.accel_noise)),
            round(gauss(mean[2], scenario.accel_noise)),
        )
        rate = -math.degrees(motion.v[2]) * 131
        gyro = scenario.gyro_stuck or (
            round(gauss(bias[0], scenario.gyro_noise)),
            round(gauss(bias[1], scenario.gyro_noise)),
            round(gauss(bias[2] + rate, scenario.gyro_noise)),
        )
        packed = struct.pack(">BB6h", 0xFF, 0xFA, *accel, *gyro)
        now = _append(truth, ("imu", accel, gyro), packed, now)
        if not scenario.imu_only and tick % 4 == 3:
            counts = [round(value * 1e4) for value in motion.pose]
            dx, dy, dtheta = (c - s for c, s in zip(counts, sent, strict=True))
            sent = counts
            delta_seq = (delta_seq + 1) % 256
            packed = struct.pack(">BB3hB", 0xFF, 0xFB, dx, dy, dtheta, delta_seq)
            now = _append(truth, ("delta", dx, dy, dtheta, delta_seq), packed, now)
            deltas += 1
            if deltas % 5 == 0:
                pose_seq = (pose_seq + 1) % 256
                packed = struct.pack(
                    ">BB3fB", 0xFF, 0xFC, *(value * 1e3 for value in motion.pose), pose_seq
                )
                floats = struct.unpack(">3f", packed[2:14])
                _append(truth, ("pose", *floats, pose_seq), packed, now)
    return truth


def _append(truth: Truth, key: Key, packed: bytes, now: float) -> float:
    """A frame that begins now; when its last byte has arrived."""
    at = len(truth.data)
    truth.data += packed
    truth.frames.append((key, at, at + len(packed)))
    truth.times_s += [now + n * BYTE_S for n in range(1, len(packed) + 1)]
    return truth.times_s[-1]


# What happens to the bytes on their way. Each fault tells, for each byte that arrives, where it
# stood in the truth, or -1 for one that was never sent.

Origins = list[int]
Fault = Callable[[int, Random], Origins]


def none(length: int, random: Random) -> Origins:
    """Nothing, but a start anywhere in the first second."""
    return list(range(random.randrange(1700), length))


def lost(rate: float) -> Fault:
    """Single bytes, each with the same probability."""

    def fault(length: int, random: Random) -> Origins:
        return [at for at in range(length) if random.random() >= rate]

    return fault


def added(rate: float) -> Fault:
    """A byte of any value, anywhere."""

    def fault(length: int, random: Random) -> Origins:
        origins: Origins = []
        for at in range(length):
            if random.random() < rate:
                origins.append(-1)
            origins.append(at)
        return origins

    return fault


def bursts(rate: float) -> Fault:
    """1 to 200 bytes in a row."""

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
    """What arrives: bytes, their times, and the truth about them."""

    data: bytes
    times_s: list[float]
    origins: Origins
    intact: list[bool]
    """For each frame of the truth, whether all its bytes arrived, with none among them."""
    truth: Truth


def receive(truth: Truth, fault: Fault, random: Random) -> Received:
    """The stream as the host's end of the line sees it."""
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


# How the host gets them: ends of chunks and the time at which each is handed over.

Chunks = list[tuple[int, float]]
Chunker = Callable[[Received, Random], Chunks]


def single_bytes(received: Received, random: Random) -> Chunks:
    """Each byte as it comes."""
    return [(at + 1, time) for at, time in enumerate(received.times_s)]


def few_bytes(received: Received, random: Random) -> Chunks:
    """One to eight bytes with the arrival time of the last, wherever the line was idle.

    But no adapter keeps a byte for longer than 16 ms.
    """
    times, chunks, at = received.times_s, [], 0
    while at < len(times):
        start, at = at, min(len(times), at + random.randint(1, 8))
        while times[at - 1] - times[start] > 0.016:
            at -= 1
        chunks.append((at, times[at - 1]))
    return chunks


def whole_bursts(received: Received, random: Random) -> Chunks:
    """All that comes without a pause, as an adapter hands it over that watches for pauses."""
    times = received.times_s
    ends = [n for n in range(1, len(times)) if times[n] - times[n - 1] > 3e-3] + [len(times)]
    return [(end, times[end - 1]) for end in ends]


def ftdi(received: Received, random: Random) -> Chunks:
    """62 bytes, or what there is when the latency timer of 16 ms runs out."""
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
    """4096 bytes at a time."""
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
