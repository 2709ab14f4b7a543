# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Generator of true streams: the frames and bytes that a board sends, with arrival times in s.

The layouts come from the manual, not from the driver's code. The noise is that of an MPU6050 with
its filter on: 46 LSB (acceleration), 6.5 LSB (gyro).
"""

import math
import struct
from dataclasses import dataclass, field
from random import Random

TICK_S = 0.01
BYTE_S = 10 / 115200

Words = tuple[int, int, int]
Key = tuple[object, ...]
"""The content of a frame: its kind, then its fields."""


@dataclass(slots=True)
class Truth:
    """A true stream: its bytes, their times of arrival in s, and its frames.

    ``frames``: for each frame, its content, the index of its first byte, and the index after its
    last byte.
    """

    data: bytearray = field(default_factory=bytearray)
    times_s: list[float] = field(default_factory=list)
    frames: list[tuple[Key, int, int]] = field(default_factory=list)


@dataclass(slots=True)
class Setpoint:
    """The velocity of a robot. It approaches random targets, or is always zero."""

    random: Random
    driving: bool
    v: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    target: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    pose: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])

    def step(self) -> tuple[float, float]:
        """Simulate one tick. Return the acceleration along the body's x and y, in m/s²."""
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
    """How a robot moves, what its IMU reads at rest, and whether its board is paused at times."""

    driving: bool = False
    imu_only: bool = False
    gyro_stuck: Words | None = None
    accel_mean: Words = (250, -130, -16380)
    accel_noise: float = 46.0
    gyro_noise: float = 6.5
    pauses: bool = False
    """Whether the board is sometimes paused for seconds. Then it sends only one text per second."""


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
    """Return what the board sends for ``seconds`` in this scenario, from a random moment on."""
    random = Random(f"{scenario} {seed}")
    gauss = random.gauss
    bias = [random.uniform(-6, 6) for _ in range(3)]
    motion = Setpoint(random, scenario.driving)
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
    """Append a frame that begins at ``now``. Return the time at which its last byte has arrived."""
    at = len(truth.data)
    truth.data += packed
    truth.frames.append((key, at, at + len(packed)))
    truth.times_s += [now + n * BYTE_S for n in range(1, len(packed) + 1)]
    return truth.times_s[-1]
